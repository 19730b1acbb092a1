"""The error of a message that an agent rejects."""


class RejectedError(ValueError):
    """A rejected message; ``cause`` is one of messages.CAUSES, under which it is counted."""

    def __init__(self, cause: str, detail: str) -> None:
        super().__init__(f"{cause}: {detail}")
        self.cause = cause
