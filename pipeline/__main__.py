"""`python -m pipeline`, the same as `shapemill`."""

from __future__ import annotations

from pipeline.interpreter import prepare_interpreter


def main() -> None:
    """Prepare the interpreter, then run the command line."""
    prepare_interpreter()
    from pipeline.cli import main as run

    run()


if __name__ == "__main__":
    main()
