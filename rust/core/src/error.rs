//! The errors of the core.

/// The reason why a run could not be made or did not finish.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Error {
    /// The method has no estimate of its error.
    #[error("the method does not estimate its error, so it cannot choose steps to a tolerance")]
    NoEstimate,
    /// An unknown system.
    #[error("there is no system {name:?}; known: {known}")]
    UnknownSystem {
        /// The name that was given.
        name: String,
        /// The known names.
        known: String,
    },
    /// An unknown method.
    #[error("there is no method {name:?}; known: {known}")]
    UnknownMethod {
        /// The name that was given.
        name: String,
        /// The known names.
        known: String,
    },
    /// An unknown option of a system.
    #[error("system {system:?} has no kernel for the options {options:?}")]
    Options {
        /// The system's name.
        system: String,
        /// The options that were given.
        options: String,
    },
    /// A method that needs ÿ = a(t, y) and a system that is not of that kind.
    #[error("{method} needs forces that do not depend on the velocity, but {system} has {term}")]
    VelocityDependent {
        /// The method's name.
        method: &'static str,
        /// The system's name.
        system: &'static str,
        /// The term that depends on the velocity.
        term: &'static str,
    },
    /// An explicit method, and a system whose mass matrix is singular.
    #[error(
        "method: {method} needs the rate of every number of the state, and algebraic equations give none; take an implicit method, \
         such as rodas5p"
    )]
    MassMatrix {
        /// The method's name.
        method: &'static str,
    },
    /// A step that is too long for one tape, which fused multiply-adds need.
    #[error("fused: a step of about {operations} operations is too long; fused multiply-adds work with steps of up to {most}")]
    TooLongToFuse {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
    },
    /// A system whose series has too many operations.
    #[error(
        "method: the series of this system has about {operations} operations a step, and may have {most}; take dop853 for a large system"
    )]
    TooLongForSeries {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
    },
    /// A step by Kepler motions that is too long.
    #[error(
        "method: a step by Kepler motions of so many bodies has about {operations} operations, and may have {most}; take leapfrog for many bodies"
    )]
    TooLongToSplit {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
    },
    /// A step that is too long to solve equations.
    #[error(
        "method: the equations of a step of this system by an implicit method have {unknowns} unknowns and up to {operations} \
         operations, and may have {most_unknowns} and {most}; take an explicit method for a system that large"
    )]
    TooLongToSolve {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
        /// Unknowns of a step.
        unknowns: usize,
        /// The most unknowns of a step.
        most_unknowns: usize,
    },
    /// A step that is too long for one tape, on which alone members have times of their own.
    #[error(
        "t0: a step of about {operations} operations is too long for times of its members' own, which work with steps of up to {most}; make \
         a run for each t0"
    )]
    TooLongForTimes {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
    },
    /// A step that is too long for one tape, which numbers of 32 bits need.
    #[error("dtype: a step of about {operations} operations is too long; float32 works with steps of up to {most}")]
    TooLongForSingle {
        /// Operations of a step.
        operations: usize,
        /// The most operations of a step.
        most: usize,
    },
    /// A part of the model that float32 does not support.
    #[error("dtype: float32 does not work with {of}; use float64")]
    NotSingle {
        /// The name of this part.
        of: &'static str,
    },
    /// Adaptive steps under a control whose push depends on the step, of a system too long for one tape.
    #[error(
        "control: with a tolerance a step that is too long for one list of operations works with a projection or the printed form only"
    )]
    ControlTooLong,
    /// Arrays that do not fit together.
    #[error("{what}: expected {expected}, got {got}")]
    Shape {
        /// The name of the array.
        what: &'static str,
        /// How many numbers it should have.
        expected: usize,
        /// How many it has.
        got: usize,
    },
    /// A CPU level that is unknown or that this machine does not have.
    #[error(transparent)]
    Level(#[from] stepwell_base::isa::UnknownLevel),
    /// A run needs more memory than there is.
    #[error("the system and its workings need {} MiB, which this process cannot have; use a smaller system or fewer threads", bytes >> 20)]
    Memory {
        /// How many bytes it would take.
        bytes: usize,
    },
    /// The caller's monitor said stop.
    #[error("interrupted")]
    Interrupted,
}
