"""Contracts of the imports that import-linter has no type for; named in pyproject.toml."""

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

__all__ = ["KnownTo", "PrivateModules"]


class _ImportContract(Contract):
    """Some imports of some modules are not allowed."""

    def _broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        raise NotImplementedError

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:  # noqa: ARG002
        """Find (importer, imported) that should not be."""
        found = self._broken(graph)
        return ContractCheck(kept=not found, metadata={"found": found})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name each."""
        for importer, module in check.metadata["found"]:
            output.print_error(f"{importer} imports {module}")


class PrivateModules(_ImportContract):
    """A module whose name begins with `_` is imported from its own package alone."""

    package = fields.StringField()

    def _broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        found = []
        for module in sorted(graph.modules):
            home, _, name = module.rpartition(".")
            if _within(module, self.package) and name.startswith("_") and name[:2] != "__":
                found += [(importer, module)
                          for importer in sorted(graph.find_modules_that_directly_import(module))
                          if _within(importer, self.package) and not _within(importer, home)]
        return found


class KnownTo(_ImportContract):
    """A library is imported by some packages of the product alone, whatever others there are."""

    package = fields.StringField()
    library = fields.StringField()
    known_to = fields.ListField(subfield=fields.StringField())

    def _broken(self, graph: ImportGraph) -> list[tuple[str, str]]:
        return [(importer, self.library)
                for importer in sorted(graph.find_modules_that_directly_import(self.library))
                if _within(importer, self.package)
                and not any(_within(importer, place) for place in self.known_to)]


def _within(module: str, package: str) -> bool:
    return f"{module}.".startswith(f"{package}.")
