#compdef fieldkit
# Completes fieldkit's commands in zsh: eval "$(fieldkit completion zsh)" behind compinit, or a file _fieldkit in $fpath.

_fieldkit() {
    local word about files=
    local -a asked found
    asked=("${(@Q)words[2,CURRENT-1]}" "${(Q)PREFIX}")
    while IFS=$'\t' read -r word about; do
        if [[ $word == :files ]]; then
            files=yes
        else
            found+=("${word//:/\\:}${about:+:$about}")
        fi
    done < <("${(Q)words[1]}" __complete "${asked[@]}" 2>/dev/null)
    (( $#found )) && _describe -V fieldkit found
    if [[ -n $files ]]; then
        compset -P '--*='
        _files
    fi
}

if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
    _fieldkit "$@"
else
    compdef _fieldkit fieldkit
fi
