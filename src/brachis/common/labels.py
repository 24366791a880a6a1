"""What a figure of a robot or a task is called, in tables, sentences and files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Label:
    """What one value of a limit is.

    Attributes
    ----------
    subject : str
        Of what: a joint's name, ``tool``, a pair of joints, ...
    kind : str
        What is limited, in words, for example ``torque``.
    unit : str
        Of the limit that the user gives.
    key : str
        Key of the task that sets it; empty without one.
    active_text, slack_text : str
        Text for "the limit is active", and for the slack that a wider bound provides. If empty, both are made of
        subject and kind.
    share : str
        What the ratio to the bound is, as the title of an axis. If empty, for example ``torque / limit``.
    cause : str
        What the user would change, for example ``feed rate``, where several values have one figure in common; empty
        where each has its own.
    """

    subject: str
    kind: str
    unit: str
    key: str = ""
    active_text: str = ""
    slack_text: str = ""
    share: str = ""
    cause: str = ""

    @property
    def after(self) -> str:
        """The unit, as it stands after a figure."""
        return "" if self.unit == "-" else f" {self.unit}"

    @property
    def axis(self) -> str:
        """Title of an axis over which ratios are drawn."""
        return self.share or f"{self.kind} / limit"

    def __str__(self) -> str:
        """Return subject and kind."""
        return f"{self.subject} {self.kind}"
