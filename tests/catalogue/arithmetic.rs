//! Tolerances.

use super::kept;
use crate::cli::Work;
use crate::common::random::Random;
use crate::common::samples::bytes;
use crate::common::series::Mask;
use wavesplat::base::sample::SampleType;

#[test]
fn below_an_ulp_every_bit_is_kept() {
    for (ty, ulp) in
        [(SampleType::F16, 2f64.powi(-10)), (SampleType::F32, 2f64.powi(-23)), (SampleType::F64, 2f64.powi(-52))]
    {
        let mut random = Random(16);
        let samples = bytes(
            ty,
            &Vec::from_iter((0..40 * 20).map(|i| if i < 40 { 1.0 + (i % 2) as f64 } else { 1.0 + random.unit() })),
        );
        for share in [1e-300, 1e-9, 0.1, 0.499, 0.999] {
            // Samples in [1, 2] are at least an ulp apart, so a smaller bound allows no other sample.
            for trial in kept(ty, Mask::None, 40, &samples, share * ulp).iter().step_by(2) {
                assert_eq!(trial.found, trial.source, "{ty} {share}");
            }
        }
        for ulps in [1.0, 1.5, 2.0, 3.0] {
            kept(ty, Mask::None, 40, &samples, ulps * ulp);
        }
    }
}

#[test]
fn tolerances_outside_0_to_1_are_refused() {
    let work = Work::new();
    work.write("a.raw", [7; 64]);
    for tolerance in ["nan", "-1", "-0.001", "inf", "-inf", "1.0000001", "2"] {
        let args = format!("convert a.raw --dims 4x4x4 --dtype u8 -o a.wspl --tolerance {tolerance}");
        work.wavesplat(&args).fails(2, &["--tolerance"]);
    }
    assert_eq!(work.names(), ["a.raw"]);
    for tolerance in ["0", "-0", "5e-324", "1e-30", "1"] {
        let args = format!("convert a.raw --dims 4x4x4 --dtype u8 -o a.wspl --force --tolerance {tolerance}");
        work.wavesplat(&args).ok();
        work.wavesplat("verify a.wspl --against a.raw --dims 4x4x4 --dtype u8").ok();
    }
}
