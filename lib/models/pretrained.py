"""Where the trained networks lie that come with the project.

    load(ProgramVAE, pretrained("program_vae_chair"))        lib.models.weights.load

Each has a card beside it: what it was trained on, how, and how well it does.
"""

from pathlib import Path

from .weights import CheckpointError

FOLDER = Path(__file__).parents[2] / "pretrained"


def pretrained(name: str, folder: Path = FOLDER) -> Path:
    """The file of trained weights called `name`. Raises CheckpointError, which names those there are, if absent."""
    path = Path(folder) / f"{name}.safetensors"
    if not path.is_file():
        there = ", ".join(sorted(each.stem for each in Path(folder).glob("*.safetensors"))) or "none at all"
        raise CheckpointError(
            f"{path}: there are no weights called {name!r}; found {there}. They come with the repository; "
            "`python -m lib.training` trains such networks"
        )
    return path
