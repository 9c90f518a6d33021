//! G70 to G72 of RS-274: the passes are those that LinuxCNC's interpreter prints.

mod common;

use cnc_msgs::contour::{ContourEventKind, MotionClass};
use cnc_msgs::geometry::Shape;
use common::profile;
use program_loader::{LoadOptions, Loaded, load};

fn read(program: &str) -> Loaded {
    load(program.as_bytes(), &profile("rs274"), &LoadOptions::default())
}

/// What a cycle does that begins at X20 Z5: `r` for a rapid, `f` for a line, `a` for an arc, with X and Z.
fn moves(profile: &str, cycle: &str) -> String {
    let program =
        format!("G21 G90 G18 F100\nG0 X20 Z5\no100 sub\n{profile}\no100 endsub\n{cycle}\nM2\n");
    let loaded = read(&program);
    assert!(loaded.is_accepted(), "{cycle}: {:#?}", loaded.findings);
    let motions = loaded.contour.events.iter().filter_map(|event| match event.kind {
        ContourEventKind::Motion(motion) => Some(motion),
        _ => None,
    });
    let text = motions.skip(1).map(|it| {
        let letter = match (it.shape, it.class) {
            (Shape::Arc(_), _) => 'a',
            (_, MotionClass::Rapid) => 'r',
            _ => 'f',
        };
        let rounded = |value: f64| (value * 1e4).round() / 1e4 + 0.0;
        format!("{letter}{},{}", rounded(it.end[0]), rounded(it.end[2]))
    });
    text.collect::<Vec<_>>().join(" ")
}

/// What is wrong with a program, with the line.
fn error(profile: &str, cycle: &str) -> String {
    let program =
        format!("G21 G90 G18 F100\nG0 X20 Z5\no100 sub\n{profile}\no100 endsub\n{cycle}\nM2\n");
    let loaded = read(&program);
    let errors: Vec<_> = loaded.findings.iter().filter(|it| it.is_error()).collect();
    assert_eq!(errors.len(), 1, "{cycle}: {errors:#?}");
    format!("{}: {}", errors[0].source.line, errors[0].message)
}

/// A shaft with a cone.
const SHAFT: &str = "G0 X5 Z2\nG1 Z-10\nX10 Z-15\nZ-20\nX16 Z-25";
/// A shaft with two grooves, one within the other.
const GROOVES: &str = "G0 X10 Z2\nG1 Z-10\nX5 Z-12\nZ-15\nX8 Z-17\nX6 Z-19\nX13 Z-21\nX16 Z-25";

#[test]
fn a_roughing_cycle_cuts_in_layers_and_then_along_the_profile() {
    for (profile, cycle, wanted) in [
        (
            SHAFT,
            "G71 Q100 D1 I6 R2",
            "f20,-24.2318 r22,-22.2318 r22,3 r20,5 r14,3.7143 f14,-22.0316 r16,-20.0316 r16,1.7143 r14,3.7143 \
             r8,2.4286 f8,-11.5858 r10,-9.5858 r10,0.4286 r8,2.4286 r6,2 f6,-9.5858 f10.7071,-14.2929 a11,-15 \
             f11,-19.5316 f16.6402,-24.2318 f20,-24.2318",
        ),
        // From X and Z of the block, with R left out.
        (
            "G0 X5 Z2\nG1 Z-10\nX10 Z-20",
            "G71 Q100 X18 Z4 I9",
            "r18,4 f18,-20 r18.5,-19.5 r18.5,3.5 r18,4 r9,2.6154 f9,-18 r9.5,-17.5 r9.5,2.1154 r9,2.6154 r5,2 \
             f5,-10 f10,-20 f18,-20",
        ),
        // A bore, from the inside.
        (
            "G0 X15 Z2\nG1 Z-5\nX10 Z-8",
            "G71 Q100 X4 I7",
            "r4,5 f4,-8 r3.5,-7.5 r3.5,4.5 r4,5 r11,3.0909 f11,-7.4 r10.5,-6.9 r10.5,2.5909 r11,3.0909 r15,2 f15,-5 \
             f10,-8 f4,-8",
        ),
        // A face.
        (
            "G0 X16 Z-15\nG1 X12 Z-13\nX0 Z0",
            "G72 Q100 I12",
            "f0,5 r0.5,5.5 r19.5,5.5 r20,5 r17.6,-7 f6.4615,-7 r6.9615,-6.5 r17.1,-6.5 r17.6,-7 r16,-15 f12,-13 f0,0 \
             f0,5",
        ),
        // Towards plus Z.
        (
            "G0 X5 Z7\nG1 Z10\nX10 Z20",
            "G71 Q100 I20",
            "f20,20 r20.5,19.5 r20.5,5.5 r20,5 r5,7 f5,10 f10,20 f20,20",
        ),
    ] {
        assert_eq!(moves(profile, cycle), wanted, "{cycle}");
    }
}

#[test]
fn g71_cuts_pockets_g71_1_leaves_them_and_g71_2_cuts_only_them() {
    for (cycle, wanted) in [
        (
            "G71 Q100 I8",
            "f20,-25 r20.5,-24.5 r20.5,4.5 r20,5 r12,2.6 f12,-20.7143 r12.5,-20.2143 r12.5,2.1 r12,2.6 r10,2 f10,-10 \
             f5,-12 f5,-15 f8,-17 f6,-19 f13,-21 f16,-25 f20,-25",
        ),
        (
            "G71.1 Q100 I8",
            "f20,-25 r20.5,-24.5 r20.5,4.5 r20,5 r12,2.6 f12,-20.7143 r12.5,-20.2143 r12.5,2.1 r12,2.6 r10,2 f10,-10 \
             f10,-20.1429 f13,-21 f16,-25 f20,-25",
        ),
        (
            "G71.2 Q100 I3",
            "r10,2 f10,-10 f10,-20.1429 r10.5,-19.6429 r10.5,-10.5 f10,-10 f7,-11.2 f7,-16.3333 r7.5,-15.8333 \
             r7.5,-11.7 f7,-11.2 f5,-12 f5,-15 f8,-17 f7,-18 f7,-19.2857 r7.5,-18.7857 r7.5,-18.5 f7,-18 f6,-19 \
             f13,-21 f16,-25 f20,-25",
        ),
    ] {
        assert_eq!(moves(GROOVES, cycle), wanted, "{cycle}");
    }
}

#[test]
fn g71_1_ends_at_a_top_beyond_the_height_where_it_begins() {
    // What comes after it is a pocket that no material covers.
    let above = "G0 X10 Z2\nG1 Z-10\nX24 Z-14\nX19 Z-18";
    let along = "f20,-12.8571 r20.5,-12.3571 r20.5,4.5 r20,5 r12,2.6 f12,-10.5714 r12.5,-10.0714 r12.5,2.1 r12,2.6 \
                 r10,2 f10,-10 f24,-14";
    assert_eq!(moves(above, "G71.1 Q100 I8"), along);
    assert_eq!(moves(&format!("{above}\nX23 Z-20"), "G71.1 Q100 I8"), along);
    let level = "G0 X10 Z2\nG1 Z-10\nX20 Z-14\nX19 Z-18";
    assert!(moves(level, "G71.1 Q100 I8").ends_with("f20,-14 f20,-18"));
}

#[test]
fn a_finishing_cycle_follows_the_profile_in_so_many_passes() {
    for (profile, cycle, wanted) in [
        (SHAFT, "G70 Q100", "r5,2 f5,-10 f10,-15 f10,-20 f16,-25"),
        (
            "G0 X5 Z2\nG1 Z-5\nX12\nZ-20",
            "G70 Q100 D3 E1 P2",
            "r7,2 f7,-3 f12,-3 a14,-5 f14,-20 r20,5 r6,2 f6,-4 f12,-4 a13,-5 f13,-20",
        ),
        // Fillets and chamfers, between lines and with an arc.
        ("G0 X5 Z2\nG1 Z-5 A1\nX12 C2\nZ-20", "G70 Q100", "r5,2 f5,-4 a6,-5 f10,-5 f12,-7 f12,-20"),
        (
            "G0 X5 Z2\nG1 Z-5 A1\nG3 X8 Z-8 I0 K-3\nG1 Z-20",
            "G70 Q100",
            "r5,2 f5,-4.127 a5.75,-5.0953 a8,-8 f8,-20",
        ),
        // U and W; G7; what D fills is left out.
        ("G0 X5 Z2\nG1 Z-10\nU10 W-5\nU1", "G70 Q100", "r5,2 f5,-10 f15,-15 f16,-15"),
        ("G0 X10 Z2\nG1 Z-10\nU4 Z-12", "G7\nG70 Q100 X40", "r5,2 f5,-10 f7,-12"),
        (
            "G0 X5 Z2\nG1 Z-5\nX4 Z-5.5\nX5 Z-6\nZ-10\nX12",
            "G70 Q100 E1",
            "r6,2 f6,-5 a5.866,-5.5 a6,-6 f6,-9 f12,-9",
        ),
        ("G0 X5 Z2\nG1 Z-5\nG2 X6 Z-6 I1 K0\nG1 X12", "G70 Q100 E1.5", "r6.5,2 f6.5,-4.5 f12,-4.5"),
        // Loops and positions count along the profile.
        (
            "G0 X5 Z2\no101 repeat [2]\nG1 Z[#<_z>-3]\nX[#<_x>+1]\no101 endrepeat",
            "G70 Q100",
            "r5,2 f5,-1 f6,-1 f6,-4 f7,-4",
        ),
        // A cone that is bored from its end: the cycle begins above it, and beside its first point.
        (
            "G0 X0 Z-10\nG1 X4 Z-7\nX10 Z-7",
            "G70 Q100 X1 Z1 E1",
            "r1,1 r0,1 r-0.6,-9.2 f3.4,-6.2 a4,-6 f10,-6",
        ),
        // Begun beyond the first point, it does not go across the part.
        ("G0 X5 Z2\nG1 Z-10\nX16 Z-25", "G70 Q100 Z-20", "r20,-20 r20,2 r5,2 f5,-10 f16,-25"),
    ] {
        assert_eq!(moves(profile, cycle), wanted, "{cycle}");
    }
}

#[test]
fn moves_along_the_profile_have_its_lines_and_the_others_that_of_the_cycle() {
    let program = "G18 F100\nG0 X20 Z5\no100 sub\nG0 X5 Z2\nG1 Z-10\nX20 Z-12\no100 endsub\nG71 Q100 I20\nX25\nM2\n";
    let loaded = read(program);
    assert!(loaded.is_accepted(), "{:#?}", loaded.findings);
    let lines = loaded.contour.events.iter().filter_map(|event| {
        let ContourEventKind::Motion(motion) = event.kind else { return None };
        Some((event.source.line, motion.class == MotionClass::Rapid, event.source.call > 0))
    });
    assert_eq!(
        lines.collect::<Vec<_>>(),
        [
            (2, true, false),
            (8, false, false),
            (8, true, false),
            (8, true, false),
            (8, true, false),
            (8, true, false),
            (5, false, true),
            (6, false, true),
            // After the cycle G1 is in force.
            (9, false, false),
        ]
    );
}

#[test]
fn what_cannot_be_cut_is_said_with_its_place_and_numbers() {
    for (profile, cycle, wanted) in [
        (
            SHAFT,
            "G71 Q100 X3",
            "10: G71 begins at X3, and its profile goes away from there, from X5 to X16: the first cut would be as \
             deep as the profile",
        ),
        (
            "G0 X5 Z2\nG1 Z-10\nX12 Z-8",
            "G71 Q100",
            "6: the profile of G71 does not run one way along Z: it turns back here",
        ),
        (
            "G0 X5 Z2\nG1 Z-10\nX3 Z-12\nX8 Z-8",
            "G70 Q100",
            "7: the profile of G70 does not run one way along Z, nor along X: it turns back here",
        ),
        (
            "G0 X5 Z2\nG1 Z-5 A8\nX12",
            "G70 Q100",
            "5: a fillet or chamfer of 8 does not fit between motions that are 7 and 7 long",
        ),
        ("G0 X5 Z2", "G72 Q100", "6: the profile of G72 in o100 has fewer than two motions"),
        ("G0 X5 Z2\nG1 Z-10", "G71 Q7", "7: there is no subroutine O7"),
        ("G0 X5 Z2\nG1 Z-10", "G17 G71 Q100", "7: G71 outside of the plane ZX"),
        (
            "G0 X5 Z2\nG1 Z-10\nX9",
            "G71 Q100 I0.0001",
            "8: G71 takes 750020 moves; at most 100000 are accepted",
        ),
        (
            "G0 X5 Z2\nG1 Z-10\nX9",
            "G70 Q100 P99999999",
            "8: G70 takes 699999993 moves; at most 100000 are accepted",
        ),
        ("G0 X5 Z2\nG1 Z-10\nG55\nX9", "G71 Q100", "6: G55 in the profile of G71"),
        ("G0 X5 Z2\nG1 Z-10\nX9 U1", "G71 Q100", "6: U and X in one block"),
        ("G0 X5 Z2\nG1 Z-10\nX9", "G71 Q100 Y1", "8: G71 with Y"),
    ] {
        assert_eq!(error(profile, cycle), wanted, "{cycle}");
    }
}
