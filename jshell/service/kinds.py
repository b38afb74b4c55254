"""The kinds of jobs, as their addresses name them: known to the server and to its client, which needs no server."""

PLURAL = {
    "fit": "fits",
    "batch": "batches",
    "simulate": "simulations",
    "modes": "modes",
    "look": "looks",
    "film": "films",
    "invert": "inversions",
}
