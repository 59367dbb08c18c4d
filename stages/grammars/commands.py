"""`shapemill grammar-clouds`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipeline.errors import ConfigError
from pipeline.options import INSPECTION

COMMANDS = typer.Typer()


@COMMANDS.command("grammar-clouds", rich_help_panel=INSPECTION)
def grammar_clouds(
    grammar: Annotated[Path, typer.Argument(help="JSON of a grammar that stage `grammars` wrote, with its .tar")],
    texts: Annotated[list[str], typer.Argument(help="derivations as in samples, such as 'S1(B0)' or 'G0[5]'")],
    out: Annotated[Path, typer.Option(help="folder for the PLY files")] = Path("datasets", "clouds"),
) -> None:
    """Write shapes of the grammar of a point cloud as PLY files."""
    from stages.grammars.derivation_text import DerivationError
    from stages.grammars.export_clouds import write_clouds
    from stages.grammars.files import load_grammar

    for path in (grammar, grammar.with_suffix(".tar")):
        if not path.is_file():
            raise ConfigError(f"there is no file {path}; a dataset's grammars are in its .work/grammars")
    loaded = load_grammar(grammar, grammar.with_suffix(".tar"))
    if not loaded.splats:
        raise ConfigError(f"{grammar}: is the grammar of a mesh, whose shapes are meshes and no clouds")
    try:
        for text, path in write_clouds(out, loaded.name, loaded, texts):
            print(f"{text:<18} {path}")
    except DerivationError as error:
        raise ConfigError(str(error)) from None
