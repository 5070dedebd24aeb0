"""Muckpile: a discrete-element model of the thrown rock with rolling resistance."""
