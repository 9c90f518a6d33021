//! What the driver asks a controller about itself.

/// Build, settings, words in force, offsets.
pub(in crate::driver) const QUERIES: [&str; 4] = ["$I", "$$", "$G", OFFSETS_QUERY];
pub(in crate::driver) const OFFSETS_QUERY: &str = "$#";
pub(in crate::driver) const BUILD_QUERY: usize = 0;
pub(in crate::driver) const SETTINGS_QUERY: usize = 1;
pub(in crate::driver) const WORDS_QUERY: usize = 2;
