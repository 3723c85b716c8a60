# The same from Julia. libwavesplat_c.so is looked for where the system finds libraries, or in LD_LIBRARY_PATH.
const library = "libwavesplat_c"

# The fields of WavesplatFrames in wavesplat.h, in their order.
Base.@kwdef struct Frames
    dims::NTuple{3,Csize_t}
    sample::UInt32 = 8 # WAVESPLAT_F64
    spacing::NTuple{3,Cdouble} = (0, 0, 0)
    origin::NTuple{3,Cdouble} = (0, 0, 0)
    coordinates::NTuple{3,Ptr{Cdouble}} = (C_NULL, C_NULL, C_NULL)
    first_time::Cdouble = 0
    time_step::Cdouble = 0
    time_unit::Cstring = C_NULL
    variable::Cstring = C_NULL
    unit::Cstring = C_NULL
end

check(status) = status == 0 || error(unsafe_string(ccall((:wavesplat_message, library), Cstring, ())))

function create(path, frames, settings)
    writer = Ref(C_NULL)
    check(ccall((:wavesplat_create, library), Int32, (Cstring, Ref{Frames}, Cstring, Int32, Ref{Ptr{Cvoid}}),
                path, frames, settings, 1, writer))
    writer[]
end

# Strides may leave out ghost cells. Julia's arrays have x fastest, too.
function push(writer, field::StridedArray{Float64,3})
    dims, sample = Ref{NTuple{3,Csize_t}}(), Ref{UInt32}()
    check(ccall((:wavesplat_frame, library), Int32, (Ptr{Cvoid}, Ref{NTuple{3,Csize_t}}, Ref{UInt32}), writer, dims, sample))
    size(field) == dims[] || error("a field of $(size(field)) for frames of $(dims[])")
    bytes = collect(Cptrdiff_t, strides(field) .* sizeof(Float64))
    GC.@preserve field check(ccall((:wavesplat_push, library), Int32, (Ptr{Cvoid}, Ptr{Float64}, Ptr{Cptrdiff_t}),
                                   writer, pointer(field), bytes))
end

finish(writer) = check(ccall((:wavesplat_finish, library), Int32, (Ptr{Cvoid},), writer))

function read_frame(path, frame, dims)
    file, samples = Ref(C_NULL), Array{Float64}(undef, dims)
    check(ccall((:wavesplat_open, library), Int32, (Cstring, UInt32, Ref{Ptr{Cvoid}}), path, 0, file))
    check(ccall((:wavesplat_read, library), Int32,
                (Ptr{Cvoid}, Csize_t, Csize_t, Ptr{Csize_t}, Ptr{Csize_t}, Csize_t, Ptr{Float64}, Csize_t),
                file[], frame - 1, 1, C_NULL, C_NULL, 0, samples, sizeof(samples)))
    ccall((:wavesplat_close, library), Cvoid, (Ptr{Cvoid},), file[])
    samples
end

function main(n = 40, steps = 64)
    field = zeros(n + 2, n + 2, n + 2)
    inner = view(field, 2:n+1, 2:n+1, 2:n+1)
    inner .= [300 + 50 * sin(0.2i) * cos(0.15j) * sin(0.1k) for i in 1:n, j in 1:n, k in 1:n]
    sides = [view(field, (2:n+1) .+ i, (2:n+1) .+ j, (2:n+1) .+ k)
             for (i, j, k) in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    writer = GC.@preserve create("run.wspl", Frames(dims = (n, n, n), time_step = 0.5), "{\"max_error\": 0.05}")
    for s in 1:steps
        push(writer, inner)
        s < steps && (inner .= inner .+ 0.1 .* (sum(sides) .- 6 .* inner))
    end
    finish(writer)
    worst = maximum(abs.(read_frame("run.wspl", steps, (n, n, n)) .- inner))
    println("$steps frames, largest error of the last one $(round(worst, digits = 4))")
    worst <= 0.05 || exit(1)
end

main()
