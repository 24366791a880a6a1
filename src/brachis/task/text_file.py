"""Reading text files, with errors that say why a file cannot be read."""

from __future__ import annotations

import errno
import io
from pathlib import Path

from brachis.errors import TaskError
from brachis.files import LARGEST_TEXT, read_file


def read_text(
    path: Path, *, where: str, folder: Path, found: str | None = None, largest: int = LARGEST_TEXT, hint: str = ""
) -> str:
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
    largest : int, optional
        Longer files are refused, bytes.
    hint : str, optional
        What to try where the file is too long.

    Raises
    ------
    TaskError
        The file is missing, is no text file, too long, or cannot be read.
    """
    try:
        with io.TextIOWrapper(io.BytesIO(read_file(path, largest)), encoding="utf-8") as text:  # any line ends
            return text.read()
    except FileNotFoundError:
        problem, hint = "there is no such file", f"Paths are relative to {folder}"
    except UnicodeDecodeError as error:
        problem, hint = f"not a text file in UTF-8: {error.reason} at byte {error.start}", ""
    except OSError as error:
        problem, hint = f"the file cannot be read: {error.strerror}", hint if error.errno == errno.EFBIG else ""
    raise TaskError(problem, found=found, where=where, hint=hint or None)
