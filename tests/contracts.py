"""Contracts of the imports that import-linter has no type for; named in pyproject.toml."""

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

__all__ = ["PrivateModules"]


class PrivateModules(Contract):
    """A module whose name begins with `_` is imported from its own package alone."""

    package = fields.StringField()

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:  # noqa: ARG002
        """Find the imports of private modules from elsewhere."""
        found = []
        for module in sorted(graph.modules):
            home, _, name = module.rpartition(".")
            if not module.startswith(f"{self.package}.") or not name.startswith("_"):
                continue
            if name.startswith("__"):
                continue
            found += [(importer, module)
                      for importer in sorted(graph.find_modules_that_directly_import(module))
                      if importer.startswith(f"{self.package}.")
                      and not f"{importer}.".startswith(f"{home}.")]
        return ContractCheck(kept=not found, metadata={"found": found})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name each."""
        for importer, module in check.metadata["found"]:
            output.print_error(f"{importer} imports {module}, which is private")
