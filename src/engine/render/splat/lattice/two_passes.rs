//! Gathers pixels in two passes (eq 38): the upright columns of cells are summed for a row of pixels, then these sums along
//! the row.

use super::bundle::{Bundle, Bundles, weighted};
use super::cells::TOGETHER;
use super::filtered::Window;
use super::upright::Upright;
use crate::render::splat::tile_rect::TileRect;
use std::ops::Range;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::codec::real::Real;

/// The sums of a tile's columns in one row of pixels, and the weights of all pixels along it.
#[derive(Debug)]
pub(super) struct TwoPasses<'a> {
    upright: &'a Upright,
    x: Range<usize>,
    /// The columns with a weight at any pixel of a row, in order.
    columns: Vec<isize>,
    /// For each pixel of a row: the index of the first column with a weight, and the weights.
    first: Vec<usize>,
    weights: Vec<f32>,
    /// The row of pixels that is summed.
    row: Option<usize>,
    single: Vec<Vec<f32>>,
    double: Vec<Vec<f64>>,
    /// For each column of cells: the first row with a weight, and the weights.
    top: Vec<isize>,
    across: Vec<f32>,
}

impl<'a> TwoPasses<'a> {
    pub(super) fn new(upright: &'a Upright, rect: &TileRect, tile: &Window, bundles: &Bundles<'_>) -> Self {
        let (x, padded) = (rect.x.clone(), upright.along.padded());
        let mut weights = vec![0.0; x.len() * padded];
        let pixels = x.clone().zip(weights.chunks_exact_mut(padded));
        let first = pixels.map(|(x, weights)| {
            let u = upright.u[0] + (x as f64 + 0.5) * upright.u[1];
            (upright.along.weights(u, weights) - tile.first[0]) as usize
        });
        let mut first: Vec<usize> = first.collect();
        let used = used(&mut first, upright.along.cells, tile.size[0]);
        let columns: Vec<isize> = used.into_iter().map(|n| tile.first[0] + n as isize).collect();
        let count = columns.len();
        Self {
            upright,
            x,
            first,
            weights,
            row: None,
            single: bundles.single.iter().map(|bundle| vec![0.0; count * bundle.places]).collect(),
            double: bundles.double.iter().map(|bundle| vec![0.0; count * bundle.places]).collect(),
            top: vec![0; count],
            across: vec![0.0; count * upright.across.padded()],
            columns,
        }
    }

    /// Sums the columns for a row of pixels, unless they are summed already.
    pub(super) fn sum_row(&mut self, y: usize, bundles: &Bundles<'_>) {
        if self.row == Some(y) {
            return;
        }
        self.row = Some(y);
        let Upright { across, v: [origin, per_row, per_column], .. } = self.upright;
        let crossing = origin + (y as f64 + 0.5) * per_row;
        let columns = self.columns.iter().zip(&mut self.top).zip(self.across.chunks_exact_mut(across.padded()));
        columns.for_each(|((u, top), weights)| *top = across.weights(crossing + *u as f64 * per_column, weights));
        let columns = Columns { u: &self.columns, top: &self.top, weights: &self.across, cells: across.cells };
        let single = self.single.iter_mut().zip(&bundles.single);
        single.for_each(|(sums, bundle)| sum_columns(bundle, &columns, sums));
        let double = self.double.iter_mut().zip(&bundles.double);
        double.for_each(|(sums, bundle)| sum_columns(bundle, &columns, sums));
    }

    /// The sums at neighbouring pixels of the row, from x on, in every bundle.
    pub(super) fn single(&self, bundle: usize, x: usize, sums: &mut [[f32; TOGETHER]]) {
        self.sum_pixels(&self.single[bundle], x, sums);
    }

    /// The same for the bundles in f64.
    pub(super) fn double(&self, bundle: usize, x: usize, sums: &mut [[f64; TOGETHER]]) {
        self.sum_pixels(&self.double[bundle], x, sums);
    }

    fn sum_pixels<R: Real>(&self, columns: &[R], x: usize, sums: &mut [[R; TOGETHER]]) {
        let (n, along, places) = (x - self.x.start, &self.upright.along, columns.len() / self.columns.len());
        let first = &self.first[n..][..sums.len()];
        let weights = &self.weights[n * along.padded()..][..sums.len() * along.padded()];
        add_pixels(columns, places, &PixelColumns { first, weights, cells: along.cells }, sums);
    }
}

/// The columns out of `all` that pixels use, each `count` of them from its `first` one on, which becomes an index into them.
fn used(first: &mut [usize], count: usize, all: usize) -> Vec<usize> {
    let mut is_used = vec![false; all];
    first.iter().for_each(|first| is_used[*first..][..count].fill(true));
    let used: Vec<usize> = (0..all).filter(|n| is_used[*n]).collect();
    let mut index = vec![0; all];
    used.iter().enumerate().for_each(|(i, n)| index[*n] = i);
    first.iter_mut().for_each(|first| *first = index[*first]);
    used
}

fn sum_columns<R: Real>(bundle: &Bundle<'_, R>, columns: &Columns<'_>, sums: &mut [R]) {
    match bundle.places {
        1 => dispatch!(add_columns::<R, 1>(bundle, columns, sums)),
        2 => dispatch!(add_columns::<R, 2>(bundle, columns, sums)),
        4 => dispatch!(add_columns::<R, 4>(bundle, columns, sums)),
        8 => dispatch!(add_columns::<R, 8>(bundle, columns, sums)),
        _ => dispatch!(add_columns::<R, TOGETHER>(bundle, columns, sums)),
    }
}

/// Columns of cells to sum.
struct Columns<'a> {
    /// Their numbers.
    u: &'a [isize],
    /// The first row with a weight in each column, and the padded weights.
    top: &'a [isize],
    weights: &'a [f32],
    /// Cells with a weight.
    cells: usize,
}

#[inline(always)]
fn add_columns<R: Real, const N: usize>(bundle: &Bundle<'_, R>, columns: &Columns<'_>, sums: &mut [R]) {
    let ([width, height], first) = (bundle.window.size, bundle.window.first);
    let (cells, taps) = (bundle.cells.as_chunks::<N>().0, columns.cells as isize);
    let of_columns = columns.top.iter().zip(columns.weights.chunks_exact(columns.weights.len() / columns.top.len()));
    for ((sums, u), (top, weights)) in sums.as_chunks_mut::<N>().0.iter_mut().zip(columns.u).zip(of_columns) {
        *sums = [R::default(); N];
        let (u, v) = (u - first[0], top - first[1]);
        let start = (-v).clamp(0, taps);
        let end = (height as isize - v).clamp(start, taps);
        if (0..width as isize).contains(&u) && start < end {
            let from = (v + start) as usize * bundle.stride + u as usize;
            *sums = weighted(&cells[from..], bundle.stride, &weights[start as usize..end as usize]);
        }
    }
}

/// The columns of neighbouring pixels.
struct PixelColumns<'a> {
    /// The first column of each pixel, and its padded weights.
    first: &'a [usize],
    weights: &'a [f32],
    /// Columns with a weight.
    cells: usize,
}

/// Sums the columns of neighbouring pixels.
fn add_pixels<R: Real>(columns: &[R], places: usize, pixels: &PixelColumns<'_>, sums: &mut [[R; TOGETHER]]) {
    match places {
        1 => dispatch!(add_rows::<R, 1>(columns, pixels, sums)),
        2 => dispatch!(add_rows::<R, 2>(columns, pixels, sums)),
        4 => dispatch!(add_rows::<R, 4>(columns, pixels, sums)),
        8 => dispatch!(add_rows::<R, 8>(columns, pixels, sums)),
        _ => dispatch!(add_rows::<R, TOGETHER>(columns, pixels, sums)),
    }
}

#[inline(always)]
fn add_rows<R: Real, const N: usize>(columns: &[R], pixels: &PixelColumns<'_>, sums: &mut [[R; TOGETHER]]) {
    let PixelColumns { first, weights, cells } = *pixels;
    let columns = columns.as_chunks::<N>().0;
    let pixels = first.iter().zip(weights.chunks_exact(weights.len() / first.len()));
    for (sums, (first, weights)) in sums.iter_mut().zip(pixels) {
        sums[..N].copy_from_slice(&weighted::<R, N>(&columns[*first..], 1, &weights[..cells]));
    }
}
