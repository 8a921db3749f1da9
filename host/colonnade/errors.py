"""The one exception for what a user can mend."""


class UserError(Exception):
    """Wrong input, or something missing on this machine.

    The message is one line: what is wrong, where, and what to do. The command line prints it after
    ``colonnade: error:`` and ends with exit status 2.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))
