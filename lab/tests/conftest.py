"""The fixtures of the host's tests."""

from conftest import *  # noqa: F403
