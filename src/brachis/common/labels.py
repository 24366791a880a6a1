"""Names of the limited quantities of a robot or a task, for tables, sentences and files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Label:
    """The label of one value of a limit.

    Attributes
    ----------
    subject : str
        What the value belongs to: the name of a joint, ``tool``, a pair of joints, ...
    kind : str
        The limited quantity, in words, for example ``torque``.
    unit : str
        Unit of the figure that the user gives.
    key : str
        Key of the task that sets the figure; empty without a key.
    active_text, slack_text : str
        Text for "the limit is active", and for the slack that a wider bound provides. By default, each text is composed
        of `subject` and `kind`.
    share : str
        Title of a plot axis that shows the ratio to the bound. Default: ``<kind> / limit``, for example ``torque /
        limit``.
    cause : str
        The setting that the user would change, for example ``feed rate``, if one setting limits several values; empty
        if each value has its own setting.
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
        """The unit, as text to append to a figure."""
        return "" if self.unit == "-" else f" {self.unit}"

    @property
    def axis(self) -> str:
        """Title of a plot axis that shows ratios to the bound."""
        return self.share or f"{self.kind} / limit"

    def __str__(self) -> str:
        """Return the subject and the kind."""
        return f"{self.subject} {self.kind}"
