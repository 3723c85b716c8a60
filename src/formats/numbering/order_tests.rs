use super::*;
use crate::testing::message;

fn paths(names: &[&str]) -> Vec<PathBuf> {
    names.iter().map(|name| PathBuf::from(format!("d/{name}.npy"))).collect()
}

/// Checks that names in any order are sorted to this one.
fn sorted(names: &[&str]) {
    let expected = paths(names);
    for mut shuffled in [expected.clone(), expected.iter().rev().cloned().collect()] {
        shuffled.rotate_left(names.len() / 3);
        assert_eq!(sort(&mut shuffled).expect("an order"), None, "{names:?}");
        assert_eq!(shuffled, expected);
    }
}

fn refused(names: &[&str]) -> String {
    message(sort(&mut paths(names)))
}

#[test]
fn decimals_exponents_and_signs_are_numbers() {
    sorted(&["u_0.0", "u_0.25", "u_0.5", "u_0.75", "u_1.0", "u_1.25", "u_1.5"]);
    sorted(&["Result-0.0005", "Result-0.001", "Result-0.0015", "Result-0.002"]);
    sorted(&["u_0", "u_0.5", "u_1", "u_1.5", "u_10", "u_10.5"]);
    sorted(&["u_0.0", "u_1e-05", "u_0.0001", "u_0.001", "u_1.5e+02", "u_2E+3"]);
    sorted(&["t=-3", "t=-2", "t=-1", "t=0", "t=1", "t=10"]);
    sorted(&["t-2", "t-1", "t0", "t1"]);
    sorted(&["x_-1.5", "x_-0.5", "x_0.5", "x_+1.5"]);
    sorted(&["u_0p0", "u_0p25", "u_0p5", "u_0p75", "u_1p0"]);
    sorted(&["t_0.1", "t_0.2", "t_0.30000000000000004", "t_0.4"]);
    sorted(&["0.5/u", "1/u", "1.5/u", "10/u"]);
}

#[test]
fn integers_after_points_and_hyphens_are_integers() {
    sorted(&["run1.8", "run1.9", "run1.10", "run1.11"]);
    sorted(&["f-1", "f-2", "f-10"]);
    sorted(&["v1.2.3", "v1.2.4", "v1.2.10"]);
    sorted(&["s1e1", "s1e2", "s1e10"]);
    sorted(&["a.0001", "a.0002", "a.0010"]);
}

#[test]
fn several_numbers_of_one_time_are_in_order() {
    let dates: Vec<String> = (2016..2018).flat_map(|y| (1..=12).map(move |m| format!("{y}-{m:02}"))).collect();
    sorted(&dates.iter().map(String::as_str).collect::<Vec<_>>());
    sorted(&["w_20160131_00", "w_20160131_12", "w_20160201_00", "w_20160201_12"]);
    sorted(&[
        "wrf_2005-08-28_00:00:00",
        "wrf_2005-08-28_12:00:00",
        "wrf_2005-08-29_00:00:00",
        "wrf_2005-08-29_12:00:00",
    ]);
    sorted(&["step_0_t_0.0", "step_10_t_0.5", "step_20_t_1.5"]);
    sorted(&["f0_scan9", "f1_scan3", "f2_scan7"]);
}

#[test]
fn names_that_count_two_things_are_refused_or_planes() {
    for names in [["t0_c0", "t0_c1", "t1_c0", "t1_c1"], ["a_1_1", "a_1_2", "a_2_1", "a_2_2"]] {
        assert!(refused(&names).contains("names count several things"), "{names:?}");
        let listed = message(check(&paths(&names)));
        assert!(listed.contains("several things") && !listed.contains("AllowGaps"), "{listed}");
    }
    let channels = refused(&["img_t0_c0", "img_t0_c1", "img_t1_c0", "img_t1_c1"]);
    assert!(channels.contains("2 numbers after \"t\", 2 numbers after \"c\"") && channels.contains("d/img_t*_c0.npy"));
    let listed = message(check(&paths(&["i_z0_t0", "i_z1_t0", "i_z0_t1", "i_z1_t1"])));
    assert!(listed.contains("to stack planes"), "{listed}");
    let mut planes = paths(&["i_z0_t0", "i_z1_t0", "i_z0_t10", "i_z1_t10", "i_z0_t9", "i_z1_t9"]);
    assert_eq!(sort(&mut planes).expect("planes"), Some(Planes(2)));
    assert_eq!(planes, paths(&["i_z0_t0", "i_z1_t0", "i_z0_t9", "i_z1_t9", "i_z0_t10", "i_z1_t10"]));
    assert!(refused(&["i_z0_t0", "i_z1_t0", "i_z0_t1"]).contains("several things"), "a plane is missing");
}

#[test]
fn numbers_that_can_be_read_in_two_ways_are_refused() {
    let text = refused(&["u_0.25", "u_0.5"]);
    assert!(text.contains("u_0.5.npy") && text.contains("u_0.25.npy") && text.contains("may come first"), "{text}");
    assert!(refused(&["u_0.1", "u_0.25", "u_0.5", "u_0.9"]).contains("in two ways"));
}

#[test]
fn missing_decimals_are_noticed() {
    let text = message(check(&paths(&["u_0.0", "u_0.5", "u_1.0", "u_2.0"])));
    assert!(text.contains("u_1.0.npy is followed by u_2.0.npy: a frame seems to be missing"), "{text}");
    check(&paths(&["u_0.33", "u_0.67", "u_1", "u_1.33"])).expect("rounded");
    let listed = message(check(&paths(&["u_0.0", "u_0.0001", "u_0.0002", "u_1e-05"])));
    assert!(listed.contains("u_1e-05"), "{listed}");
    check_one_series(&paths(&["u_0", "u_0.5", "u_1"])).expect("one series");
}
