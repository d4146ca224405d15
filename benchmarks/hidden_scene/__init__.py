"""A bench whose scene has one number wrong, or none, and which a diagnosis never sees.

The files of outcomes belong to the engines that `docs/guides/scene-causes.md` names. They do not say whose rival each
rival is: all are given with the first cause.
"""
