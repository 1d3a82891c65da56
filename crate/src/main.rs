//! The `tracklens` command.

fn main() -> std::process::ExitCode {
    tracklens::cli::main()
}
