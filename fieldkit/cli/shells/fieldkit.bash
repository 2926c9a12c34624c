# Completes fieldkit's commands in bash: eval "$(fieldkit completion bash)"

_fieldkit() {
    local index word about reply trimmed rest=$COMP_LINE current=${COMP_WORDS[COMP_CWORD]} files=
    local -a words=()
    # Bash parts words at "=" and ":" too; what no space stands between is one word again.
    for ((index = 0; index <= COMP_CWORD; index++)); do
        word=${COMP_WORDS[index]}
        trimmed=${rest#"${rest%%[![:space:]]*}"}
        if ((index)) && [[ -n $word && $trimmed == "$rest" ]]; then
            words[${#words[@]} - 1]+=$word
        else
            words+=("$word")
        fi
        rest=${trimmed#"$word"}
    done
    [[ $current == [=:] ]] && current=
    local whole=${words[${#words[@]} - 1]}
    local prefix=${whole%"$current"} # in front of what readline replaces
    COMPREPLY=()
    while IFS=$'\t' read -r word about; do
        if [[ $word == :files ]]; then
            files=yes
        else
            COMPREPLY+=("${word#"$prefix"}")
        fi
    done < <("$1" __complete "${words[@]:1}" 2>/dev/null)
    if [[ $files ]]; then
        compopt -o filenames -o default 2>/dev/null
        while IFS= read -r reply; do
            COMPREPLY+=("$reply")
        done < <(compgen -f -- "$current")
    fi
}

complete -o nosort -F _fieldkit fieldkit
