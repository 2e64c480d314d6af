"""What a driver must know to go on after its process died, as bytes and back."""

from __future__ import annotations

from typing import Generic, TypeVar

import msgspec

KnowledgeT = TypeVar('KnowledgeT', bound=msgspec.Struct)


class DriverMemory(Generic[KnowledgeT]):
    """
    Encodes what a driver knows, into the same object for as long as that is the same.

    Numbers come back bit for bit (MessagePack), infinite ones too.

    Parameters
    ----------
    knowledge_type
        A frozen struct.

    """

    def __init__(self, knowledge_type: type[KnowledgeT]) -> None:
        self._type = knowledge_type
        self._knowledge: KnowledgeT | None = None
        self._encoded = b''

    def encode(self, knowledge: KnowledgeT) -> bytes:
        """Return the bytes of it; the same object as before if they are the same."""
        if knowledge is not self._knowledge:
            encoded = msgspec.msgpack.encode(knowledge)
            self._knowledge = knowledge
            self._encoded = self._encoded if encoded == self._encoded else encoded
        return self._encoded

    def decode(self, memory: bytes) -> KnowledgeT:
        """
        Return what was encoded.

        Raises
        ------
        ValueError
            These are not the bytes of this type.

        """
        try:
            return msgspec.msgpack.decode(memory, type=self._type)
        except msgspec.DecodeError as error:
            raise ValueError(f'memory is not that of this driver: {error}') from None
