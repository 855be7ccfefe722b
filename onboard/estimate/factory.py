"""Makes the relative filter that a fleet file asks for."""

from config import fleet
from onboard.estimate.beliefs import RelativeFilter, RelativePrior
from onboard.estimate.relative_ukf import RelativeUkf


def make_relative_filter(
    settings: fleet.RelativeFilter,
    own_wheelbase_m: float,
    leader_wheelbase_m: float,
    prior: RelativePrior,
) -> RelativeFilter:
    """The filter of kind `settings.kind`, started from `prior`."""
    if settings.kind == "reference":
        # Loads scipy: a second and 90 MB that only the filters on filterpy are worth.
        from onboard.estimate.reference_filter import ReferenceFilter

        return ReferenceFilter.from_prior(settings, own_wheelbase_m, leader_wheelbase_m, prior)
    if settings.kind == "paper":
        from onboard.estimate.paper_filter import PaperFilter

        return PaperFilter.from_prior(settings.paper, own_wheelbase_m, leader_wheelbase_m, prior)
    return RelativeUkf.from_prior(settings, own_wheelbase_m, leader_wheelbase_m, prior)
