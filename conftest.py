"""What holds for the tests of all packages."""

from hypothesis import settings

# How long an example takes says how busy the machine is, not whether the code is right.
settings.register_profile(
    'shearwater', deadline=None, derandomize=True, database=None, max_examples=40
)
# Others each time, for as long as there is time: --hypothesis-profile search
settings.register_profile('search', deadline=None, derandomize=False, max_examples=400)
settings.load_profile('shearwater')
