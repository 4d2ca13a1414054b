"""Laws fitted to a store, with intervals and goodness of fit."""
