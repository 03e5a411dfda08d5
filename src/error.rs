//! The one error type of the library.

/// Everything that can go wrong before or after a solve. A solve that does not converge is not an error but a result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The user's input is wrong; the message says what is wrong, where, and what to do. Exit code 2.
    #[error("{0}")]
    Input(String),
    /// As [`Error::Input`], from code that knows the key of the scenario but not the file that set it.
    /// `LoadedScenario::locate` adds file and line.
    #[error("{key}: {what}")]
    Key {
        /// The dotted key, for instance `gait.phases[1]`.
        key: String,
        /// What was given and what is allowed.
        what: String,
    },
    /// As [`Error::Input`], about the value of a key of a TOML file. Exit code 2.
    #[error("{file}{}: {key}: {what}", line.map(|line| format!(":{line}")).unwrap_or_default())]
    Value {
        /// The file, or the override that set the value.
        file: String,
        /// The line that set the value, from 1; none for an override, and where the value is missing.
        line: Option<usize>,
        /// The dotted key.
        key: String,
        /// What was given and what is allowed.
        what: String,
    },
    /// A file could not be read or written. Exit code 2.
    #[error("{path}: {}", in_words(source))]
    Io {
        /// The file.
        path: String,
        /// What the operating system reported.
        source: std::io::Error,
    },
    /// A failure that no input should cause.
    #[error("internal error: {0}")]
    Internal(String),
}

/// Shorthand used throughout the library.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An input error with a message.
    pub fn input(message: impl Into<String>) -> Self {
        Error::Input(message.into())
    }

    /// An error in the value of a key of the scenario.
    pub fn key(key: impl Into<String>, what: impl std::fmt::Display) -> Self {
        Error::Key { key: key.into(), what: what.to_string() }
    }

    /// An I/O error at a path.
    pub fn io(path: impl AsRef<std::path::Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().display().to_string(), source }
    }
}

/// What the operating system reported, without its number of the error.
fn in_words(error: &std::io::Error) -> String {
    let text = error.to_string();
    match text.rfind(" (os error ") {
        Some(at) => text[..at].to_owned(),
        None => text,
    }
}
