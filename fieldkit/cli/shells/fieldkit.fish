# Completes fieldkit's commands in fish: fieldkit completion fish | source

function __fieldkit_complete
    set -l words (commandline -opc)
    set -l current (commandline -ct)
    set -l program $words[1]
    set -e words[1]
    for line in ($program __complete $words "$current" 2>/dev/null)
        if test "$line" = ":files"
            set -l prefix (string match -r -- '^--[^=]+=' "$current")
            for path in (__fish_complete_path (string replace -r -- '^--[^=]+=' '' "$current"))
                echo -- "$prefix$path"
            end
        else
            echo -- $line
        end
    end
end

complete -c fieldkit -f -k -a '(__fieldkit_complete)'
