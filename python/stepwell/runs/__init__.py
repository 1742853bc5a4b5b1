"""How a model is stepped: ``integrate``, ``World``, events, and what is noticed of a run."""
