"""How well a model explains a material: materials, scenes, expressions and their engine, fits, metrics."""
