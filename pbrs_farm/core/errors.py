"""The exceptions of pbrs_farm; no effects.

PbrsError                 every error a user can meet; one clear line, no traceback
├── BadInput              a file or an argument given by the user is wrong
│   ├── BadHouse          a house's source: the file and the place inside it
│   └── BadRecipe         a recipe, a preset's name or a --set
├── RenderFailed          a picture could not be made: view, mode and seed reproduce it
├── StoreFailed           an object could not be read or written: its key
│   ├── ObjectMissing     there is no object under that key
│   ├── StoreRefused      the whole store is closed to us: credentials, bucket, read-only
│   └── StoreUnavailable  the store did not answer; Transient
└── MachineFailed         this machine lacks something: LLVM, EGL, a package

Transient                 a second base; only errors that carry it are worth another try
"""

from __future__ import annotations

from pbrs_farm.core.shown_text import MAX_MESSAGE, MAX_PLACE, shown


class PbrsError(Exception):
    """An error whose text says what, where, and what to do next, in one line that can be printed.

    hint: what to do next, or "".

        >>> try:
        ...     pf.load("nowhere.sh3d")
        ... except pf.PbrsError as error:
        ...     type(error).__name__
        'BadHouse'
    """

    def __init__(self, message: str, *, hint: str = "") -> None:
        message = shown(message, MAX_MESSAGE)
        super().__init__(message)
        self.message = message
        self.hint = shown(hint, MAX_MESSAGE)

    def __str__(self) -> str:
        return f"{self.message} ({self.hint})" if self.hint else self.message

    def __reduce__(self) -> tuple[object, ...]:
        # Exceptions cross process boundaries: rebuild without calling subclass constructors.
        return (_rebuild, (type(self), dict(self.__dict__)))


def _rebuild(cls: type[PbrsError], state: dict[str, object]) -> PbrsError:
    error = cls.__new__(cls)
    error.__dict__.update(state)
    Exception.__init__(error, state.get("message", ""))
    return error


class Transient(Exception):
    """Second base of errors that may pass by themselves; only these are retried."""


class BadInput(PbrsError):
    """A file or an argument given by the user is wrong.

    file: the file's path or name.  place: where inside it ("wall w3", "line 12"), or "".

        >>> str(pf.BadInput("flat.sh3d", "wall w3", "has no length", hint="draw it anew"))
        'flat.sh3d: wall w3: has no length (draw it anew)'
    """

    def __init__(self, file: object, place: str, message: str, *, hint: str = "") -> None:
        where = shown(file, 2 * MAX_PLACE) + (f": {shown(place, MAX_PLACE)}" if place else "")
        super().__init__(f"{where}: {message}", hint=hint)
        self.file = str(file)
        self.place = place
        self.text = message


class BadHouse(BadInput):
    """A house's source cannot be read or repaired; names the file and the place inside it.

    >>> issubclass(pf.BadHouse, pf.BadInput)
    True
    """


class BadRecipe(PbrsError):
    """A recipe, a preset's name or an override is not valid.

    >>> try:
    ...     recipe_from_name("fats")
    ... except pf.BadRecipe as error:
    ...     error.message
    "no recipe 'fats'"
    """


class RenderFailed(PbrsError):
    """A picture could not be made; view, mode and seed reproduce it.

    >>> pf.RenderFailed("no light", view="0_0_s1", mode="light", seed=7).seed
    7
    """

    def __init__(self, message: str, *, view: str, mode: str, seed: int, hint: str = "") -> None:
        super().__init__(f"{message} (view {view}, mode {mode}, seed {seed})", hint=hint)
        self.view = view
        self.mode = mode
        self.seed = seed


class StoreFailed(PbrsError):
    """An object could not be read from or written to the store; names its key.

    >>> pf.StoreFailed("houses/a/house.glb", "no space is left").key
    'houses/a/house.glb'
    """

    def __init__(self, key: str, message: str, *, hint: str = "") -> None:
        super().__init__(f"{key}: {message}", hint=hint)
        self.key = key


class ObjectMissing(StoreFailed):
    """There is no object under that key."""


class StoreRefused(StoreFailed):
    """The whole store is closed to us: wrong credentials, no such bucket, a read-only folder."""


class StoreUnavailable(StoreFailed, Transient):
    """The store did not answer; the same call may succeed later."""


class MachineFailed(PbrsError):
    """This machine lacks something a step needs; the hint says how to get it.

    >>> pf.MachineFailed("no LLVM", hint="apt-get install libllvm19").hint
    'apt-get install libllvm19'
    """
