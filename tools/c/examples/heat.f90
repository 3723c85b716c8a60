! The same from Fortran: the inner part of an array with ghost cells is pushed as it is, with the time of each step, since steps grow.
program heat
    use, intrinsic :: iso_c_binding
    use wavesplat
    implicit none
    integer, parameter :: n = 40, steps = 64
    real(c_double), target :: field(0:n + 1, 0:n + 1, 0:n + 1), around(n, n, n)
    character(kind=c_char), target :: unit(2) = ['K', c_null_char]
    type(wavesplat_frames) :: frames
    type(c_ptr) :: writer
    real(c_double) :: time, rate
    integer :: i, j, k, s

    field = 0
    do concurrent(i=1:n, j=1:n, k=1:n)
        field(i, j, k) = 300 + 50 * sin(0.2d0 * i) * cos(0.15d0 * j) * sin(0.1d0 * k)
    end do
    frames = wavesplat_frames(dims=[n, n, n], sample=wavesplat_f64, unit=c_loc(unit))
    call wavesplat_check(wavesplat_create("run.wspl", frames, '{"max_error": 0.05}', .true., writer))
    time = 0
    do s = 1, steps
        call wavesplat_check(wavesplat_push(writer, field(1:n, 1:n, 1:n), time))
        rate = 0.05d0 + 0.001d0 * s
        time = time + rate
        around = field(0:n - 1, 1:n, 1:n) + field(2:n + 1, 1:n, 1:n) + field(1:n, 0:n - 1, 1:n) &
            + field(1:n, 2:n + 1, 1:n) + field(1:n, 1:n, 0:n - 1) + field(1:n, 1:n, 2:n + 1)
        field(1:n, 1:n, 1:n) = field(1:n, 1:n, 1:n) + rate * (around - 6 * field(1:n, 1:n, 1:n))
    end do
    call wavesplat_check(wavesplat_finish(writer))
    print '(i0, a)', steps, ' frames'
end program
