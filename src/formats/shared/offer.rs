//! The variables that a file offers.

use wavesplat_core::source::VariableInfo;

/// The variables of a file.
#[derive(Debug, Default)]
pub(crate) struct Offer {
    /// Those that can be chosen by name.
    pub(crate) variables: Vec<VariableInfo>,
    /// Whether the user must choose: it is not clear which one is meant.
    pub(crate) is_undecided: bool,
}
