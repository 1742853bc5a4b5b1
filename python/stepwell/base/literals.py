"""The words that arguments take, as types: an editor completes them, and a type checker finds what is written wrongly."""

from __future__ import annotations

from typing import Literal

#: How a run makes its steps.
RunForm = Literal["direct", "matrix", "power"]

#: How a step is explained.
StepForm = Literal["direct", "matrix"]

#: What computes a run.
Backend = Literal["rust", "numpy"]

#: What is between samples of an input.
Interpolation = Literal["hold", "linear", "cubic"]

#: What the velocity of an oscillator is.
OscillatorForm = Literal["canonical", "physical"]

#: How an aircraft's attitude is written.
AttitudeForm = Literal["euler", "quaternion"]

#: The force between two bodies.
BodyForce = Literal["logarithmic", "newton", "printed"]

#: What a surface does to a point behind it.
ContactWay = Literal["safe", "restitution", "flip", "spring"]

#: In which direction a quantity passes a level.
Direction = Literal["rising", "falling", "both"]

#: How a control divides by what it keeps.
ControlForm = Literal["limited", "printed"]

#: What advice ranks by.
Cost = Literal["time", "evaluations"]

#: In which numbers methods are compared.
Dtypes = Literal["float64", "float32", "both"]

#: Languages of exported steps.
LanguageName = Literal["c", "javascript", "python", "rust"]
