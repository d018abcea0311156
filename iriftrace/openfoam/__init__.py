"""OpenFOAM for users without a solver of their own: writes, runs and reads one kind of case.

Natural convection of air around a hot part, with the solver ``buoyantPimpleFoam``.
"""
