! wavesplat for Fortran: the functions of wavesplat.h, which says what they do.
module wavesplat
    use, intrinsic :: iso_c_binding
    use, intrinsic :: iso_fortran_env, only: error_unit
    implicit none
    private
    public :: wavesplat_frames, wavesplat_create, wavesplat_push, wavesplat_finish, wavesplat_abandon, wavesplat_check

    integer(c_int32_t), parameter, public :: wavesplat_ok = 0, wavesplat_f32 = 7, wavesplat_f64 = 8

    type, bind(c) :: wavesplat_frames
        integer(c_size_t) :: dims(3)
        integer(c_int32_t) :: sample
        real(c_double) :: spacing(3) = 0, origin(3) = 0
        type(c_ptr) :: coordinates(3) = c_null_ptr
        real(c_double) :: first_time = 0, time_step = 0
        type(c_ptr) :: time_unit = c_null_ptr, variable = c_null_ptr, unit = c_null_ptr
    end type

    interface
        integer(c_int32_t) function create(path, frames, settings, replace, writer) bind(c, name="wavesplat_create")
            import
            character(kind=c_char), intent(in) :: path(*), settings(*)
            type(wavesplat_frames), intent(in) :: frames
            integer(c_int32_t), value :: replace
            type(c_ptr), intent(out) :: writer
        end function

        integer(c_int32_t) function push(writer, samples, strides) bind(c, name="wavesplat_push")
            import
            type(c_ptr), value :: writer, samples, strides
        end function

        integer(c_int32_t) function push_at(writer, time, samples, strides) bind(c, name="wavesplat_push_at")
            import
            type(c_ptr), value :: writer, samples, strides
            real(c_double), value :: time
        end function

        integer(c_int32_t) function frame(writer, dims, sample) bind(c, name="wavesplat_frame")
            import
            type(c_ptr), value :: writer
            integer(c_size_t), intent(out) :: dims(3)
            integer(c_int32_t), intent(out) :: sample
        end function

        integer(c_int32_t) function wavesplat_finish(writer) bind(c)
            import
            type(c_ptr), value :: writer
        end function

        subroutine wavesplat_abandon(writer) bind(c)
            import
            type(c_ptr), value :: writer
        end subroutine

        type(c_ptr) function message() bind(c, name="wavesplat_message")
            import
        end function

        integer(c_size_t) function strlen(text) bind(c)
            import
            type(c_ptr), value :: text
        end function
    end interface

    ! Adds a frame: a whole array, or a part of one such as field(1:n, 1:n, 1:n); with its time where steps differ.
    interface wavesplat_push
        procedure push_f32, push_f64
    end interface

contains

    ! Begins a file, in place of an old one if told so.
    integer(c_int32_t) function wavesplat_create(path, frames, settings, replace, writer) result(status)
        character(*), intent(in) :: path, settings
        type(wavesplat_frames), intent(in) :: frames
        logical, intent(in) :: replace
        type(c_ptr), intent(out) :: writer
        integer(c_int32_t) :: replaces
        replaces = merge(1_c_int32_t, 0_c_int32_t, replace)
        status = create(trim(path) // c_null_char, frames, settings // c_null_char, replaces, writer)
    end function

    integer(c_int32_t) function push_f32(writer, field, time) result(status)
        type(c_ptr), intent(in) :: writer
        real(c_float), intent(in), target :: field(:, :, :)
        real(c_double), intent(in), optional :: time
        call check_frame(writer, shape(field, c_size_t), wavesplat_f32)
        status = pushed(writer, c_loc(field(1, 1, 1)), c_loc(field(min(2, size(field, 1)), 1, 1)), &
                        c_loc(field(1, min(2, size(field, 2)), 1)), c_loc(field(1, 1, min(2, size(field, 3)))), time)
    end function

    integer(c_int32_t) function push_f64(writer, field, time) result(status)
        type(c_ptr), intent(in) :: writer
        real(c_double), intent(in), target :: field(:, :, :)
        real(c_double), intent(in), optional :: time
        call check_frame(writer, shape(field, c_size_t), wavesplat_f64)
        status = pushed(writer, c_loc(field(1, 1, 1)), c_loc(field(min(2, size(field, 1)), 1, 1)), &
                        c_loc(field(1, min(2, size(field, 2)), 1)), c_loc(field(1, 1, min(2, size(field, 3)))), time)
    end function

    ! Pushes the frame whose first sample, and the next ones along x, y and z, are there.
    integer(c_int32_t) function pushed(writer, first, x, y, z, time) result(status)
        type(c_ptr), intent(in) :: writer, first, x, y, z
        real(c_double), intent(in), optional :: time
        integer(c_size_t), target :: strides(3)
        strides = [step(first, x), step(first, y), step(first, z)]
        if (present(time)) then
            status = push_at(writer, time, first, c_loc(strides))
        else
            status = push(writer, first, c_loc(strides))
        end if
    end function

    ! Stops unless a field is what the frames of a writer are.
    subroutine check_frame(writer, dims, sample)
        type(c_ptr), intent(in) :: writer
        integer(c_size_t), intent(in) :: dims(3)
        integer(c_int32_t), intent(in) :: sample
        integer(c_size_t) :: expected(3)
        integer(c_int32_t) :: kind_of
        call wavesplat_check(frame(writer, expected, kind_of))
        if (all(dims == expected) .and. sample == kind_of) return
        write (error_unit, '(a, 3(1x, i0), a, 3(1x, i0))') 'wavesplat_push: a field of', dims, &
            ', or of another kind, for frames of', expected
        error stop
    end subroutine

    ! Bytes from a sample to another.
    integer(c_size_t) function step(from, to)
        type(c_ptr), intent(in) :: from, to
        step = transfer(to, 0_c_size_t) - transfer(from, 0_c_size_t)
    end function

    ! Stops with the message of an error.
    subroutine wavesplat_check(status)
        integer(c_int32_t), intent(in) :: status
        character(kind=c_char), pointer :: text(:)
        type(c_ptr) :: said
        if (status == wavesplat_ok) return
        said = message()
        call c_f_pointer(said, text, [strlen(said)])
        write (error_unit, '(*(a))') text
        error stop
    end subroutine
end module
