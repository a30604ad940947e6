MODULE HandNone
    ! An arm without a SmartGripper: every command of the hand is refused.

    PROC HandCalibrate()
        RAISE 1;
    ENDPROC

    PROC HandGrip(num nForce)
        RAISE 1;
    ENDPROC

    PROC HandMove(num nWidth)
        RAISE 1;
    ENDPROC

    FUNC num HandWidth()
        RAISE 1;
        RETURN 0;
    ENDFUNC

    PROC HandVacuum(bool bOn)
        RAISE 1;
    ENDPROC

    PROC HandBlow(bool bOn)
        RAISE 1;
    ENDPROC
ENDMODULE
