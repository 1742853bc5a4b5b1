"""The strings that arguments take, as types: an editor completes them, and a type checker finds misspelled ones."""

from __future__ import annotations

from typing import Literal

#: How the steps of a run, and a step that is explained, are computed: by the method's formulas, or by the transition matrix.
StepForm = Literal["direct", "matrix"]

#: What computes a run.
Backend = Literal["rust", "numpy"]

#: The values of an input between its samples.
Interpolation = Literal["hold", "linear", "cubic"]

#: How an input of a sampled system runs from one sample to the next.
SampleInterpolation = Literal["hold", "linear"]

#: How an input runs within a step whose frequency response is charted.
InputBetween = Literal["sine", "hold", "linear"]

#: What the velocity of an oscillator is.
OscillatorForm = Literal["canonical", "physical"]

#: The coordinates of an aircraft's attitude.
AttitudeForm = Literal["euler", "quaternion"]

#: The force between two bodies.
BodyForce = Literal["logarithmic", "newton", "printed"]

#: How a surface acts on a point behind it.
ContactWay = Literal["safe", "restitution", "flip", "spring"]

#: The direction in which a quantity passes a level.
Direction = Literal["rising", "falling", "both"]

#: Whether the push of a control is limited, or as Hoffmann prints it.
ControlForm = Literal["limited", "printed"]

#: What advice ranks by.
Cost = Literal["time", "evaluations"]

#: The dtypes in which methods are compared.
Dtypes = Literal["float64", "float32", "both"]

#: Languages of exported steps.
LanguageName = Literal["c", "csharp", "javascript", "python", "rust"]
