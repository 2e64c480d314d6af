"""Workers of a campaign on a Dask cluster that runs already. Dask is an optional dependency."""

from __future__ import annotations

from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Self

from c3_station.campaign_mission import MissionResult, fly_missions
from c3_station.campaign_run import PoolLostError
from c3_station.software import this_software

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Future

    from c3_station.campaign_plan import MissionJob

_GONE = (CancelledError, OSError)
"""Dask cancels what was under way, or cannot send what is next."""

_CONNECT_S = 10
"""A scheduler that does not answer within this time is not there, seconds."""


class DaskPool:
    """The workers of a Dask cluster; its scheduler tries a mission again when a worker dies."""

    def __init__(self, address: str) -> None:
        """
        Connect to a scheduler, such as ``tcp://10.0.0.5:8786``.

        Raises
        ------
        ValueError
            Dask is not installed, there is no such scheduler, it has no workers, or they cannot
            fly the same missions as this machine.

        """
        try:
            from distributed import Client, KilledWorker
        except ImportError:
            raise ValueError(
                '--dask: Dask is not installed; allowed after'
                ' `.venv/bin/python -m pip install distributed`'
            ) from None
        self._address = address
        self.died: tuple[type[Exception], ...] = (KilledWorker,)
        try:
            self._client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ValueError(f'--dask {address}: no scheduler answers there: {error}') from None
        try:
            self._check_workers(address)
        except BaseException:
            self._client.close()
            raise
        self._executor = self._client.get_executor(pure=False)

    @property
    def places(self) -> int:
        """Return two for every thread of the cluster as it is now: it may grow and shrink."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, 2 * sum(threads.values()))

    def submit(self, jobs: Sequence[MissionJob]) -> Future[list[MissionResult]]:
        """Have missions flown by one worker."""
        future: Future[list[MissionResult]] = self._executor.submit(fly_missions, jobs)
        return future

    def renew(self) -> None:
        """Leave that to the cluster."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: object
    ) -> None:
        """
        Leave the cluster; when something has happened, it shall not fly on for us.

        Raises
        ------
        PoolLostError
            What has happened is that the scheduler is gone.

        """
        if isinstance(failure, _GONE):
            self._client.close()
            raise PoolLostError(f'--dask {self._address}: the scheduler is gone') from None
        self._executor.shutdown(wait=failure is None)
        self._client.close()

    def _check_workers(self, address: str) -> None:
        """Refuse by its address a worker that would refuse the missions; others may join later."""
        try:
            found = self._client.run(this_software)
        except ModuleNotFoundError as error:
            raise ValueError(
                f'--dask {address}: its workers do not have Shearwater installed: {error}'
            ) from None
        if not found:
            raise ValueError(f'--dask {address}: the cluster has no workers')
        for worker, software in found.items():
            if software != this_software():
                raise ValueError(
                    f'--dask {address}: worker {worker} has other code, {software};'
                    f' allowed: that of this machine, {this_software()}'
                )
