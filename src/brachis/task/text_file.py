"""Reading text files, with errors that say why a file cannot be read."""

from __future__ import annotations

from pathlib import Path

from brachis.errors import TaskError


def read_text(path: Path, *, where: str, folder: Path, found: str | None = None) -> str:
    """Return the content of a text file in UTF-8.

    Parameters
    ----------
    path : Path
        The file.
    where : str
        Place that messages name: the file itself, or the key that asks for it.
    folder : Path
        What relative paths are relative to, for the message that there is no such file.
    found : str, optional
        The file, for messages whose place is a key.

    Raises
    ------
    TaskError
        The file is missing, is no text file, or cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        problem, hint = "there is no such file", f"Paths are relative to {folder}"
    except UnicodeDecodeError as error:
        problem, hint = f"not a text file in UTF-8: {error.reason} at byte {error.start}", None
    except OSError as error:
        problem, hint = f"the file cannot be read: {error.strerror}", None
    raise TaskError(problem, found=found, where=where, hint=hint)
