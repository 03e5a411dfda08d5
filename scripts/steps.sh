# Shared by the scripts beside it: go to the top of the repository, and do things step by step, quietly.
# shellcheck shell=bash

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

export CARGO_TERM_COLOR=never # logs are files
log_dir=target/log
mkdir -p "$log_dir"

# say WORDS: one line for the person who waits.
say() { printf '%s\n' "$*"; }

# fail WORDS: says what is wrong and what to do, and ends the script.
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# commit: which commit this is, for programs that say so in what they write; unknown outside of a repository.
commit() { git describe --always --dirty --abbrev=12 --exclude='*' 2>/dev/null || echo unknown; }

# step WORDS COMMAND…: runs the command with its output in a log file, which is shown only if it fails.
step() {
    local words=$1 started=$SECONDS log
    shift
    log="$log_dir/$(tr -cs 'a-z0-9' '-' <<<"${words,,}" | sed 's/^-*//; s/-*$//').log"
    printf '  %-48s' "$words"
    if "$@" >"$log" 2>&1 </dev/null; then
        printf '%4d s\n' $((SECONDS - started))
    else
        local code=$?
        printf 'FAILED after %d s\n\n' $((SECONDS - started))
        tail -n 200 "$log" >&2
        fail "\"$words\" ended with exit code $code; the whole log is $log. The command was: $*"
    fi
}
