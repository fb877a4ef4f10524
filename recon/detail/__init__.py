"""Detail that the broad fit smooths away: local averages, rim, holes, symmetry, shading."""
