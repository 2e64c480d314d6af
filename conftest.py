"""What holds for the tests of all packages."""

from hypothesis import settings

# How long an example takes says how busy the machine is, not whether the code is right.
settings.register_profile('shearwater', deadline=None)
settings.load_profile('shearwater')
