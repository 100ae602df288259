"""The claims of P2: multiple-model filters."""

from radarsim.studies.interface import Paper

PAPER = Paper(
    "Sychev & Osipov 2023", page="multimodel", may_grow=("filters",), held_too={"multimodel_families": ("P2.8", "P2.9")}
)
