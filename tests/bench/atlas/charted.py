"""What a map is: two axes, what a cell of it runs and compares with, and the border that theory draws."""
from dataclasses import dataclass

import numpy as np

from atlas.judge import DEFAULT


@dataclass(frozen=True)
class Axis:
    label: str
    values: tuple
    names: tuple = ()  # of the values, where numbers do not tell

    def name(self, index):
        return self.names[index] if self.names else f"{self.values[index]:g}"

    def place(self, value):
        """Where a value stands between the cells' middles 0, 1, …: linear between neighbours, by logarithms where all
        are positive and spread over more than a factor of 20."""
        known = np.array(self.values, float)
        scale = np.log if known.min() > 0 and known.max() > 20 * known.min() else np.asarray
        known, at = scale(known), scale(np.asarray(value, float))
        i = np.clip(np.searchsorted(known, at), 1, len(known) - 1)
        return i - 1 + (at - known[i - 1]) / (known[i] - known[i - 1])


@dataclass(frozen=True)
class Border:
    label: str
    points: tuple  # (x, y) in the axes' own numbers


@dataclass(frozen=True)
class Map:
    name: str
    title: str
    x: Axis
    y: Axis
    measure: object  # measure(runner, method, x, y, seed) -> relative error of the answer
    truth: str
    borders: tuple = ()
    methods: tuple = (DEFAULT,)

    def cells(self):
        return [(i, j) for j in range(len(self.y.values)) for i in range(len(self.x.values))]
