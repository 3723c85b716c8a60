//! Compares the measurements of an archive with the targets.

use super::convert::Scheme;
use super::measured::{Measured, further};
use super::plan::{Coded, Plan, key};
use super::results::{Archive, Row, Threshold, Value};

/// The files, spacings and numbers of threads of an archive, and its measurements.
pub(super) struct Evaluation<'a> {
    pub(super) plan: &'a Plan<'a>,
    pub(super) found: &'a Archive,
}

/// One view of one file.
#[derive(Clone, Copy)]
struct Case<'a> {
    file: &'a Coded,
    spacing: f64,
    threads: usize,
}

/// Volumes of at least this many voxels have the targets of 256^3.
const LARGE: usize = 192 * 192 * 192;
/// Views with at least this many pixels between voxels have the targets of 2.3 pixels, others those of 1 pixel.
const WIDE: f64 = 1.65;
/// Files with at most this share of nonzero codes per sample have a target of their own.
const FEW_CODES: f64 = 0.02;
/// The target for the default choice of method. It is this project's own, to show when the choice is wrong.
const CHOICE: f64 = 1.1;

impl Evaluation<'_> {
    /// All rows of the archive.
    pub(super) fn rows(&self) -> Vec<Row> {
        let Plan { files, spacings, threads, .. } = self.plan;
        let mut rows = Vec::new();
        for (threads, file) in threads.iter().flat_map(|t| files.iter().map(|f| (*t, f))) {
            rows.extend(spacings.iter().flat_map(|spacing| self.of_view(Case { file, spacing: *spacing, threads })));
            rows.extend(self.of_conversion(file, threads));
        }
        rows
    }

    /// The targets apply to the first file: the default scheme at the first tolerance.
    fn wanted(&self, file: &Coded, wanted: Threshold) -> Option<Threshold> {
        (*file == self.plan.files[0]).then_some(wanted)
    }

    fn of_view(&self, case: Case<'_>) -> Vec<Row> {
        let Case { file, spacing, threads } = case;
        let name = format!("{}, {spacing} px, {threads} thread(s)", file.name());
        let row = |target: &str, value: Value, wanted: Threshold| {
            Row::new(target, &self.found.data.name, name.clone(), value, self.wanted(file, wanted))
        };
        let at_least = Threshold::AtLeast;
        let mut rows = vec![
            row(
                "view of decoded codes, times faster than the textbook form",
                self.beside_textbook(case),
                at_least(50.0),
            ),
            row(
                "view of decoded codes, times faster than the best conventional",
                self.beside_best(case),
                self.best_wanted(spacing),
            ),
            row(
                "splat stage, times faster than the best conventional's",
                self.splat_stage(case),
                self.stage_wanted(file, threads),
            ),
            row(
                "first view, nothing cached, times faster than the best conventional",
                self.first_cold(case),
                at_least(10.0),
            ),
            row("further view of an archive larger than memory, times faster", self.larger(case), at_least(20.0)),
            row(
                "view from the file, times faster than SZ3 by frame + best conventional",
                self.beside_sz3(case),
                at_least(10.0),
            ),
        ];
        for (renderer, what) in [("vtk-cpu", "VTK on the CPU"), ("vtk-mesa", "VTK on Mesa")] {
            let target = format!("view from the file, times faster than {what}, additive");
            rows.push(row(&target, self.beside_vtk(case, renderer), at_least(50.0)));
        }
        let bare = "view from the file / (zstd of its parts + view of decoded codes)";
        rows.push(row(bare, self.beside_zstd(case), Threshold::AtMost(1.2)));
        if file.scheme == Scheme::Auto {
            rows.push(row("default method / faster of codes and values", self.choice(case), Threshold::AtMost(CHOICE)));
        }
        if file.scheme == Scheme::Auto && threads == self.plan.threads[0] {
            let error = |i| self.image_error(case, i);
            rows.push(row("largest image error of the default method / maximum", error(0), Threshold::AtMost(1.5e-3)));
            rows.push(row("rms image error of the default method / maximum", error(1), Threshold::AtMost(6e-4)));
        }
        rows
    }

    fn of_conversion(&self, file: &Coded, threads: usize) -> Vec<Row> {
        let name = format!("{}, {threads} thread(s)", file.name());
        let row = |target: &str, value: Value, wanted: Threshold| {
            Row::new(target, &self.found.data.name, name.clone(), value, self.wanted(file, wanted))
        };
        let read = "conversion throughput / plain read of the same map";
        let mut rows = vec![row(read, self.beside_read(file, threads), Threshold::AtLeast(0.08))];
        if threads == self.plan.threads[0] {
            rows.push(row(
                "conversion, times faster with two threads",
                self.two_threads(file),
                Threshold::AtLeast(1.7),
            ));
        }
        rows
    }

    fn best_wanted(&self, spacing: f64) -> Threshold {
        let large = self.found.data.dims.iter().product::<usize>() >= LARGE;
        Threshold::AtLeast(if large {
            4.0
        } else if spacing >= WIDE {
            2.0
        } else {
            3.0
        })
    }

    fn stage_wanted(&self, file: &Coded, threads: usize) -> Threshold {
        let converted = self.found.measured.get(&key("convert", Some(file), None, threads));
        let few = converted.and_then(|m| m.codes_per_sample).is_some_and(|share| share <= FEW_CODES);
        Threshold::AtLeast(if few { 15.0 } else { 4.0 })
    }

    fn at(&self, key: &str) -> Result<&Measured, String> {
        let why = || self.found.missing.get(key).cloned().unwrap_or_else(|| "not measured".into());
        self.found.measured.get(key).ok_or_else(why)
    }

    fn view(&self, case: Case<'_>) -> Result<(&Measured, f64), String> {
        let view = self.at(&key("view", Some(case.file), Some(case.spacing), case.threads))?;
        Ok((view, further(view).of(case.threads)))
    }

    /// Seconds for bare decoding of the bytes that a view read; 0 if it read nothing because all blocks were decoded
    /// before.
    fn codes(&self, view: &Measured, case: Case<'_>) -> Result<f64, String> {
        let codes = self.at(&key("codes", Some(case.file), None, case.threads))?;
        let share = if codes.bytes == 0 { 0.0 } else { view.bytes as f64 / codes.bytes as f64 };
        Ok(share * codes.time.of(case.threads))
    }

    /// Seconds of a view without decoding.
    fn decoded(&self, case: Case<'_>) -> Result<f64, String> {
        let (view, seconds) = self.view(case)?;
        let left = seconds - self.codes(view, case)?;
        if left > 0.0 { Ok(left) } else { Err("lost in the noise: no longer than bare decoding".into()) }
    }

    fn conventional(&self, what: &str, case: Case<'_>) -> Result<(&Measured, f64), String> {
        let found = self.at(&key(what, None, Some(case.spacing), case.threads))?;
        Ok((found, further(found).of(case.threads)))
    }

    /// The faster of the conventional forms.
    pub(super) fn best(&self, spacing: f64, threads: usize) -> &'static str {
        let time = |what| self.at(&key(what, None, Some(spacing), threads)).map(|m| further(m).of(threads));
        match (time("direct"), time("textbook")) {
            (Ok(direct), Ok(textbook)) if textbook < direct => "textbook",
            _ => "direct",
        }
    }

    fn beside_textbook(&self, case: Case<'_>) -> Value {
        let (_, textbook) = self.conventional("textbook", case)?;
        Ok((textbook / self.decoded(case)?, String::new()))
    }

    fn beside_best(&self, case: Case<'_>) -> Value {
        let best = self.best(case.spacing, case.threads);
        let (found, seconds) = self.conventional(best, case)?;
        Ok((seconds / self.decoded(case)?, format!("best: {best}, {}", found.method.as_deref().unwrap_or_default())))
    }

    fn splat_stage(&self, case: Case<'_>) -> Value {
        let (view, seconds) = self.view(case)?;
        let own = seconds * view.splatting.ok_or("not reported")? - self.codes(view, case)?;
        let (direct, seconds) = self.conventional("direct", case)?;
        let direct = seconds * direct.splatting.ok_or("not reported")?;
        let textbook = self.conventional("textbook", case).and_then(|t| Ok(t.1 - self.conventional("set-up", case)?.1));
        let (best, name) = match textbook {
            Ok(textbook) if textbook < direct => (textbook, "textbook"),
            _ => (direct, "direct"),
        };
        let converted = self.at(&key("convert", Some(case.file), None, case.threads))?;
        let codes = 100.0 * converted.codes_per_sample.ok_or("not reported")?;
        let note = format!("best: {name}; {codes:.1} % of codes are nonzero");
        if own.min(best) > 0.0 { Ok((best / own, note)) } else { Err("lost in the noise".into()) }
    }

    /// Wall time with an empty cache, if most of the input came from storage.
    fn cold(&self, what: &str, file: Option<&Coded>, case: Case<'_>) -> Result<f64, String> {
        let found = self.at(&key(what, file, Some(case.spacing), case.threads))?;
        let all = if file.is_some() { found.bytes } else { self.found.data.bytes };
        match found.from_storage {
            Some(read) if 2 * read >= all => Ok(found.time.wall),
            Some(read) => {
                Err(format!("not measured: the cache kept {:.0} % of it", 100.0 - 100.0 * read as f64 / all as f64))
            }
            None => Err("not measured: the system does not tell what it cached".into()),
        }
    }

    fn first_cold(&self, case: Case<'_>) -> Value {
        let own = self.cold("cold view", Some(case.file), case)?;
        Ok((self.cold("cold frames", None, case)? / own, "wall time".into()))
    }

    /// Compares uncached frames with a cached file.
    fn larger(&self, case: Case<'_>) -> Value {
        let own = further(self.view(case)?.0).wall;
        let note = "wall time; the cache of the frames emptied before the view";
        Ok((self.cold("cold frames", None, case)? / own, note.into()))
    }

    fn beside_sz3(&self, case: Case<'_>) -> Value {
        let sz3 = self.at(&format!("sz3-3d {:e}", case.file.tolerance))?;
        if case.threads > 1 {
            return Err("not measured: SZ3's time is of one thread".into());
        }
        let (_, best) = self.conventional(self.best(case.spacing, case.threads), case)?;
        Ok(((sz3.time.processor + best) / self.view(case)?.1, String::new()))
    }

    fn beside_vtk(&self, case: Case<'_>, renderer: &str) -> Value {
        let vtk = self.at(&key(renderer, None, Some(case.spacing), case.threads))?;
        Ok((vtk.time.of(case.threads) / self.view(case)?.1, String::new()))
    }

    fn beside_zstd(&self, case: Case<'_>) -> Value {
        let bare = self.at(&key("payloads", Some(case.file), None, case.threads))?.time.of(case.threads);
        Ok((self.view(case)?.1 / (bare + self.decoded(case)?), String::new()))
    }

    fn choice(&self, case: Case<'_>) -> Value {
        let values = self.at(&key("values", Some(case.file), Some(case.spacing), case.threads))?;
        let (view, codes) = self.view(case)?;
        let method = view.method.clone().unwrap_or_default();
        Ok((codes / codes.min(further(values).of(case.threads)), format!("default: {method}")))
    }

    fn image_error(&self, case: Case<'_>, which: usize) -> Value {
        let found = self.at(&key("errors", Some(case.file), Some(case.spacing), 0))?;
        let (largest, rms) = *found.errors.first().ok_or("not measured")?;
        Ok(([largest, rms][which], "against exact splatting of the same file".into()))
    }

    fn beside_read(&self, file: &Coded, threads: usize) -> Value {
        let read = self.at(&key("read", None, None, 1)).or_else(|_| self.at(&key("read", None, None, threads)))?;
        let converted = self.at(&key("convert", Some(file), None, threads))?;
        let rate = self.found.data.bytes as f64 / converted.time.of(threads) / 1e6;
        Ok((read.time.of(threads) / converted.time.of(threads), format!("{rate:.0} MB/s")))
    }

    fn two_threads(&self, file: &Coded) -> Value {
        let why = |_| "not measured: needs --threads 1,2".to_string();
        let wall = |threads| self.at(&key("convert", Some(file), None, threads)).map(|m| m.time.wall).map_err(why);
        Ok((wall(1)? / wall(2)?, "wall time".into()))
    }
}
