//! Known fits: closed forms, a published example, and an independent maximiser.

use super::super::tests::{assert_close, assert_interval};
use super::*;

/// Neovasculation, pulsatility index, endometrium height in hundredths, and whether the grade is high, of 79
/// patients with endometrial cancer. Neovasculation separates the grades.
///
/// Source: Heinze and Schemper (2002); R's `logistf::endometrial`.
const ENDOMETRIAL: [(u8, u8, u16, u8); 79] = [
    (0, 13, 164, 0),
    (0, 16, 226, 0),
    (0, 8, 314, 0),
    (0, 34, 268, 0),
    (0, 20, 128, 0),
    (0, 5, 231, 0),
    (0, 17, 180, 0),
    (0, 10, 168, 0),
    (0, 26, 156, 0),
    (0, 17, 231, 0),
    (0, 8, 201, 0),
    (0, 7, 189, 0),
    (0, 20, 315, 0),
    (0, 10, 123, 0),
    (0, 18, 127, 0),
    (0, 16, 176, 0),
    (0, 18, 200, 0),
    (0, 8, 264, 1),
    (0, 29, 88, 1),
    (0, 12, 127, 1),
    (0, 20, 137, 1),
    (1, 38, 97, 1),
    (1, 22, 114, 1),
    (1, 7, 88, 1),
    (1, 25, 91, 1),
    (1, 15, 58, 1),
    (0, 7, 97, 1),
    (0, 28, 150, 0),
    (0, 11, 133, 0),
    (0, 19, 237, 0),
    (0, 10, 182, 0),
    (0, 10, 313, 0),
    (0, 18, 131, 0),
    (0, 14, 192, 0),
    (0, 21, 164, 0),
    (0, 11, 201, 0),
    (0, 17, 188, 0),
    (0, 25, 193, 0),
    (0, 16, 211, 0),
    (0, 19, 129, 0),
    (0, 15, 172, 0),
    (0, 33, 75, 0),
    (0, 24, 192, 0),
    (0, 48, 184, 1),
    (0, 12, 111, 1),
    (0, 19, 161, 1),
    (0, 2, 118, 1),
    (1, 22, 144, 1),
    (1, 40, 118, 1),
    (1, 5, 93, 1),
    (1, 0, 117, 1),
    (0, 21, 119, 1),
    (0, 15, 106, 1),
    (0, 29, 202, 0),
    (0, 15, 229, 0),
    (0, 12, 233, 0),
    (0, 3, 290, 0),
    (0, 20, 170, 0),
    (0, 23, 141, 0),
    (0, 12, 225, 0),
    (0, 22, 154, 0),
    (0, 42, 197, 0),
    (0, 15, 175, 0),
    (0, 13, 216, 0),
    (0, 14, 257, 0),
    (0, 19, 137, 0),
    (0, 12, 361, 0),
    (0, 13, 204, 0),
    (0, 10, 217, 0),
    (0, 12, 169, 1),
    (1, 49, 27, 1),
    (0, 6, 184, 1),
    (0, 5, 130, 1),
    (0, 17, 96, 1),
    (1, 11, 101, 1),
    (1, 21, 98, 1),
    (0, 5, 35, 1),
    (1, 19, 102, 1),
    (0, 33, 85, 1),
];

fn with_intercept(x: &[f64]) -> Vec<Vec<f64>> {
    x.iter().map(|&x| vec![1.0, x]).collect()
}

fn assert_fit(found: &[Estimate], expected: &[(f64, [f64; 2])], allowed: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, &(value, interval)) in found.iter().zip(expected) {
        assert_close(found.value, value, allowed);
        assert_interval(found.interval, interval, allowed);
    }
}

#[test]
fn the_endometrial_cancer_study_comes_out_as_published() {
    let rows: Vec<Vec<f64>> = ENDOMETRIAL
        .iter()
        .map(|&(nv, pi, eh, _)| vec![1.0, f64::from(nv), f64::from(pi), f64::from(eh) / 100.0])
        .collect();
    let outcomes: Vec<bool> = ENDOMETRIAL.iter().map(|row| row.3 == 1).collect();
    let found = firth(&rows, &outcomes, 0.95).unwrap();
    // The same penalised likelihood maximised by SciPy 1.17.1: optimize.minimize (BFGS), then
    // optimize.root on the score; ends of the intervals by optimize.brentq.
    let recorded = [
        (
            3.774_559_713_647_116,
            [1.082_537_108_447_698, 7.209_280_498_246_903],
        ),
        (
            2.929_273_353_197_120_7,
            [0.609_724_436_303_202_6, 7.854_631_713_877_393],
        ),
        (
            -0.034_751_759_870_436_73,
            [-0.124_458_720_851_727_96, 0.040_455_473_180_614_04],
        ),
        (
            -2.604_163_925_293_683,
            [-4.365_183_247_263_23, -1.232_721_057_216_994_2],
        ),
    ];
    assert_fit(&found, &recorded, 1e-9);
    // As R's logistf prints it.
    let printed = [
        (3.774_560, [1.082_537, 7.209_280]),
        (2.929_273, [0.609_724, 7.854_632]),
        (-0.034_752, [-0.124_459, 0.040_455]),
        (-2.604_164, [-4.365_183, -1.232_721]),
    ];
    assert_fit(&found, &printed, 0.6e-6);
}

#[test]
fn separated_answers_have_a_finite_fit() {
    let x = [
        -30.0, -21.0, -12.0, -9.0, -4.0, 3.0, 6.0, 8.0, 15.0, 22.0, 27.0, 33.0,
    ];
    let outcomes = x.map(|x| x > 0.0);
    let found = firth(&with_intercept(&x), &outcomes, 0.95).unwrap();
    // SciPy 1.17.1, as above.
    let recorded = [
        (
            0.244_021_109_717_374_12,
            [-2.559_586_004_672_945_5, 3.223_710_995_914_23],
        ),
        (
            0.217_041_077_125_175_34,
            [0.042_633_660_774_160_705, 0.917_212_990_301_722_1],
        ),
    ];
    assert_fit(&found, &recorded, 1e-9);
}

#[test]
fn answers_that_overlap_are_fitted_at_any_level() {
    let x = [
        -40.0, -33.0, -25.0, -20.0, -14.0, -11.0, -7.0, -3.0, 2.0, 5.0, 9.0, 12.0, 18.0, 24.0,
        30.0, 37.0,
    ];
    let outcomes = [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 1, 0, 1, 1, 1].map(|y| y == 1);
    let found = firth(&with_intercept(&x), &outcomes, 0.9).unwrap();
    // NumPy 2.4.6: scoring steps to 1e-14; ends by SciPy 1.17.1, optimize.brentq.
    let recorded = [
        (
            0.044_520_476_172_976_9,
            [-0.843_348_139_059_922_7, 0.948_657_482_738_478_9],
        ),
        (
            0.045_707_955_436_045_46,
            [0.005_525_175_316_350_927, 0.099_863_109_356_867_17],
        ),
    ];
    assert_fit(&found, &recorded, 1e-9);
}

#[test]
fn with_one_binary_covariate_half_an_answer_is_added_to_each_cell() {
    // Firth (1993): for a saturated model the penalty is Jeffreys' prior, ½ in every cell.
    let cells = [(0.0, false, 7), (0.0, true, 3), (1.0, true, 8)];
    let answers = cells
        .iter()
        .flat_map(|&(x, y, n)| std::iter::repeat_n((x, y), n));
    let (x, outcomes): (Vec<f64>, Vec<bool>) = answers.unzip();
    let found = firth(&with_intercept(&x), &outcomes, 0.95).unwrap();
    let logit = |yes: f64, no: f64| ((yes + 0.5) / (no + 0.5)).ln();
    assert_close(found[0].value, logit(3.0, 7.0), 1e-9);
    assert_close(found[1].value, logit(8.0, 0.0) - logit(3.0, 7.0), 1e-9);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let told = firth(&[vec![1.0, 2.0], vec![1.0, 2.0]], &[true, false], 0.95);
    assert_eq!(
        told,
        Err(FirthError::Singular),
        "a column that follows from the other"
    );
    let told = firth(&[vec![1.0], vec![1.0, 2.0]], &[true, false], 0.95);
    assert!(matches!(told, Err(FirthError::Shape { .. })));
    let told = firth(&[], &[], 0.95);
    assert!(matches!(told, Err(FirthError::Shape { .. })));
    let told = firth(&[vec![f64::NAN], vec![1.0]], &[true, false], 0.95);
    assert_eq!(told, Err(FirthError::Singular));
}
