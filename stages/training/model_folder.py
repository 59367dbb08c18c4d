"""A finished training: the best weights, the curves, and the model card."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.stage import Outcome, Task
from stages.training.rounds import subject_fields

MODEL_FILES = {"weights.safetensors", "curves.csv", "curves.png", "README.md"}
"""Files of a model's folder."""

Row = Mapping[str, Any]


def publish_model(task: Task) -> Outcome:
    """Write the files of MODEL_FILES, each as `<shard>.<file>`."""
    from stages.training.checkpoint import checkpoint_bytes, load_checkpoint, tensors_below

    params = task.shard.params
    rows = [json.loads(task.input("training", f"{shard}.json").read_bytes()) for shard in params["rounds"]]
    best = task.input("training", f"{params['rounds'][params['best']]}.safetensors")
    tensors, header = load_checkpoint(best, {"kind": params["kind"], **subject_fields(params)})
    weights = tensors_below(tensors, "weights")
    header |= {key: params[key] for key in ("name", "dataset", "license")}
    figures = {"rounds": len(rows), "best": rows[params["best"]]}
    files = {
        "weights.safetensors": checkpoint_bytes(weights, header),
        "curves.csv": curves_csv(rows).encode(),
        "curves.png": curves_png(rows, params["best"]),
        "README.md": model_card(header, figures, sum(tensor.numel() for tensor in weights.values())).encode(),
    }
    for file, content in files.items():
        with task.output(f"{task.shard.name}.{file}") as stream:
            stream.write(content)
    return Outcome(samples=0, summary=figures)


def curves_csv(rows: Sequence[Row]) -> str:
    """Return the figures of each round, one line a round."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def curves_png(rows: Sequence[Row], best: int) -> bytes:
    """Plot every figure of train and val over the steps, and mark the best round."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(key.partition("_")[2] for key in rows[0] if key.startswith(("train_", "val_"))))
    figure = Figure(figsize=(3.2 * len(names), 3.0), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    steps = [row["step"] for row in rows]
    for panel, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        for split in ("train", "val"):
            if f"{split}_{name}" in rows[0]:
                panel.plot(steps, [row[f"{split}_{name}"] for row in rows], marker=".", label=split)
        panel.axvline(steps[best], color="grey", linestyle=":", linewidth=1)
        panel.set(title=name, xlabel="steps")
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(alpha=0.25)
        panel.legend(frameon=False)
    stream = io.BytesIO()
    figure.savefig(stream, metadata={"Software": None})
    return stream.getvalue()


def model_card(header: Mapping[str, Any], figures: Mapping[str, Any], parameters: int) -> str:
    """Return the model card, as Markdown."""
    best = figures["best"]
    rows = [f"| {name} | {value:.4g} |" for name, value in best.items() if isinstance(value, float)]
    settings = [f"| `{key}` | `{json.dumps(value)}` |" for key, value in header["settings"].items()]
    counts = [
        f"| {split} | {' | '.join(f'{count:,}' for count in of_split.values())} |"
        for split, of_split in header["counts"].items()
    ]
    kinds = list(next(iter(header["counts"].values())))
    subject = " ".join(f"{what} `{name}`" for what, name in subject_fields(header).items())
    lines = [
        "---",
        f"license: {header['license'].lower()}",
        "---",
        "",
        f"# {header['name']}",
        "",
        f"A `{header['kind']}` of {subject}, trained on dataset {header['dataset']}: {parameters:,} "
        f"parameters, the best of {figures['rounds']} rounds, after {best['step']:,} steps on {header['device']} in "
        f"{header['precision']}.",
        "",
        "The header of `weights.safetensors` holds all that is needed to read it: kind, settings, vocabulary, and the "
        "sha256 of samples and code. `curves.csv` and `curves.png` show the training.",
        "",
        "## Data",
        "",
        f"Licence of the data: {header['license']}.",
        "",
        f"| split | {' | '.join(kinds)} |",
        f"|---|{'---:|' * len(kinds)}",
        *counts,
        "",
        "## Figures",
        "",
        "| figure | best round |",
        "|---|---:|",
        *rows,
        "",
        "## Settings",
        "",
        "| setting | value |",
        "|---|---|",
        *settings,
    ]
    return "\n".join(lines) + "\n"
