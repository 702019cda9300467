"""How good a model is: metrics on tables and on images, cards, physical checks, the time of a call."""
