//! Random numbers that are the same everywhere, and what they do to a program.

/// SplitMix64: a seed gives the same cases on every machine.
#[derive(Debug, Clone)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        // Neighbouring seeds are to have nothing in common.
        let mut random = Self(seed.wrapping_mul(0xD1B5_4A32_D192_ED03));
        random.next();
        random
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number below `end`, which is not 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// A number between two others.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Whether something happens once in so many times.
    pub(crate) fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }

    pub(crate) fn of<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }
}

/// Numbers at the edges of what is taken.
const NUMBERS: [&str; 20] = [
    "0",
    "-0",
    "0.0001",
    "-0.0001",
    "1e3",
    "1E9",
    "999999.999",
    "-1000000",
    "1000000.1",
    ".",
    "-",
    "5",
    "-5",
    "10.0000001",
    "0.00000001",
    "123456789012345678901234567890",
    "NaN",
    "inf",
    "2.5.1",
    "360",
];

/// Words of all controls, and what is none.
const WORDS: [&str; 40] = [
    "G0 ",
    "G1 ",
    "G2 ",
    "G3 ",
    "G4 X1 ",
    "G9 ",
    "G17 ",
    "G18 ",
    "G19 ",
    "G20 ",
    "G28 X0 ",
    "G38 ",
    "G39 ",
    "G40 ",
    "G41 ",
    "G42 ",
    "G41.1 D3 ",
    "G43 P2 ",
    "G53 ",
    "G90 ",
    "G91 ",
    "G450 ",
    "G451 ",
    "G452 ",
    "G455 ",
    "G456 ",
    "M0 ",
    "M2 ",
    "M6 ",
    "M30 ",
    "D1 ",
    "D2 ",
    "T1 ",
    "T010101 ",
    "Z-5 ",
    "I10 J0 ",
    "X20 Y20 ",
    "F0 ",
    "(",
    "/",
];

/// Changes a program in a few places; `other` is where foreign lines come from.
pub(crate) fn mutate(text: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = text.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    for _ in 0..random.below(6) {
        let at = random.below(lines.len());
        match random.below(12) {
            0 if lines.len() > 1 => {
                lines.remove(at);
            }
            1 => lines.insert(at, lines[at].clone()),
            2 => {
                let with = random.below(lines.len());
                lines.swap(at, with);
            }
            3 => {
                let foreign: Vec<&[u8]> = other.split(|&byte| byte == b'\n').collect();
                let line = random.of(&foreign).to_vec();
                lines.insert(at, line);
            }
            4 | 5 => {
                let place = random.below(lines[at].len() + 1);
                let word = random.of(&WORDS).as_bytes().iter().copied();
                lines[at].splice(place..place, word);
            }
            6 => {
                let place = random.below(lines[at].len() + 1);
                lines[at].insert(place, random.next() as u8);
            }
            7 if !lines[at].is_empty() => {
                let place = random.below(lines[at].len());
                lines[at][place] ^= 1 << random.below(8);
            }
            _ => new_number(&mut lines[at], random),
        }
    }
    lines.join(&b'\n')
}

/// Gives one word of a line another number.
fn new_number(line: &mut Vec<u8>, random: &mut Random) {
    let is_number = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+');
    let starts: Vec<usize> = (1..line.len())
        .filter(|&place| is_number(&line[place]) && line[place - 1].is_ascii_alphabetic())
        .collect();
    if starts.is_empty() {
        return;
    }
    let start = *random.of(&starts);
    let length = line[start..].iter().take_while(|byte| is_number(byte)).count();
    let number = match random.below(3) {
        0 => (*random.of(&NUMBERS)).to_owned(),
        1 => format!("{}", random.below(200) as i32 - 100),
        _ => format!("{:.3}", random.between(-100.0, 100.0)),
    };
    line.splice(start..start + length, number.bytes());
}

/// Gives a few words other numbers, on a grid and near to what they were: programs that are
/// programs still.
pub(crate) fn renumber(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut text = text.to_vec();
    for _ in 0..1 + random.below(3) {
        let is_number = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-');
        let starts: Vec<usize> = (1..text.len())
            .filter(|&place| {
                is_number(&text[place])
                    && matches!(
                        text[place - 1],
                        b'X' | b'Y' | b'Z' | b'I' | b'J' | b'K' | b'R' | b'P' | b'D'
                    )
            })
            .collect();
        if starts.is_empty() {
            return text;
        }
        let start = *random.of(&starts);
        let length = text[start..].iter().take_while(|byte| is_number(byte)).count();
        let was: f64 = std::str::from_utf8(&text[start..start + length])
            .ok()
            .and_then(|text| text.parse().ok())
            .unwrap_or(0.0);
        let number = match random.below(9) {
            0 => -was,
            1 => was + 10.0,
            2 => was - 10.0,
            3 => was / 2.0,
            4 => was * 2.0,
            5 => was + *random.of(&[1e-3, -1e-3, 2e-3, 0.01, -0.01, 0.1, 1.0, -1.0]),
            6 => (was * 100.0).round() / 100.0,
            7 => 5.0 * (random.below(41) as f64 - 20.0),
            _ => random.between(-100.0, 100.0).round(),
        };
        let number = format!("{number:.4}");
        let number = number.trim_end_matches('0').trim_end_matches('.');
        text.splice(start..start + length, number.bytes());
    }
    text
}
