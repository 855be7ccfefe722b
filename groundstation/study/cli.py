"""`echelon study`: the paper's section 4 and Monte-Carlo studies of the estimators."""

import typer

study_app = typer.Typer(
    help="Monte-Carlo studies against theory: the paper's section 4, the estimators' bounds.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@study_app.callback()
def _study() -> None:
    """Keeps `echelon study` a group however many studies there are."""
