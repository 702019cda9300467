"""Genomes: ordered edits that turn a starting expression into a new one, and the codebank they insert from."""

from gpsearch.genomes.edits import Delete, Edit, Insert, Replace, Swap
from gpsearch.genomes.genome import Genome, crossover, reify
from gpsearch.genomes.mutation import Mutation, codebank, random_edit

__all__ = [
    "Delete",
    "Edit",
    "Genome",
    "Insert",
    "Mutation",
    "Replace",
    "Swap",
    "codebank",
    "crossover",
    "random_edit",
    "reify",
]
