"""kinespace names the movement a performer is doing, live; `kinespace.stream` and `kinespace.library` are its parts."""


def __getattr__(name: str) -> str:
    """Give `__version__` when it is asked for; reading it takes time that every start of a program would need."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - as the docstring says

    try:
        return version("kinespace")
    except PackageNotFoundError:
        return "unknown"
