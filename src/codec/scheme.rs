//! Schemes: which transform and which pyramid the blocks of a window are coded with.

use crate::wavelet::{self, TimeBasis};
pub(crate) use wavesplat_format::{Axis, Basis, Pyramid, Stencil, Window};

/// How the blocks of one window are coded.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheme {
    /// The transform along time.
    pub basis: Basis,
    /// The learned functions, if the basis is [`Basis::Learned`].
    pub functions: Vec<i16>,
    /// How coefficients, or samples, are refined; none: each is coded by itself.
    pub pyramid: Option<Pyramid>,
    /// The step in units of the one for which rounding alone keeps the promise. Samples that then miss it are stored exactly.
    pub coarseness: f64,
}

impl Scheme {
    /// A transform along time alone, as [Dobashi](crate::bibliography) has it.
    pub fn along_time(basis: Basis) -> Self {
        Self { basis, functions: Vec::new(), pyramid: None, coarseness: 1.0 }
    }

    /// As a window of a file says.
    pub fn of_window(window: &Window) -> Self {
        let (functions, pyramid) = (window.functions.clone(), window.pyramid.clone());
        Self { basis: window.basis, functions, pyramid, coarseness: window.coarseness }
    }

    /// The transform along time of a window of `frames` frames.
    pub(crate) fn time_basis(&self, frames: usize) -> Box<dyn TimeBasis> {
        wavelet::basis(self.basis, &self.functions, frames)
    }

    /// Its name for reports: the transform, and what refines it along which axes.
    pub(crate) fn name(&self) -> String {
        let Some(pyramid) = &self.pyramid else { return self.basis.name().into() };
        let axes: String = pyramid.order.iter().map(|axis| format!("{axis:?}").to_lowercase()).collect();
        let stencil = format!("{:?}", pyramid.stencil).to_lowercase();
        match self.basis {
            Basis::Samples => format!("pyramid ({stencil} {axes})"),
            basis => format!("{} + pyramid ({stencil} {axes})", basis.name()),
        }
    }
}
