"""One erratum's effect: what the paper says, and one number for either reading."""

import msgspec


class Effect(msgspec.Struct, frozen=True):
    """`literal` is what the paper's reading does, `corrected` what ours does, in `unit`."""

    name: str
    equation: str
    says: str
    corrected_to: str
    quantity: str
    unit: str
    literal: float
    corrected: float

    def line(self) -> str:
        """The effect in one line."""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.name}: {self.equation}, {self.says} -> {self.quantity} "
            f"{self.literal:.4g}{unit}; {self.corrected_to}: {self.corrected:.4g}{unit}"
        )
