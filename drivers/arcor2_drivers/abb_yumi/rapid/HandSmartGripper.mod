MODULE HandSmartGripper
    ! The SmartGripper, by the instructions of its add-in. Without the add-in use HandNone.mod instead.
    ! Widths are in mm, forces in N.

    PROC HandCalibrate()
        g_Init\maxSpd:=20,\holdForce:=10;
        g_Calibrate;
    ENDPROC

    PROC HandGrip(num nForce)
        g_SetForce nForce;
        g_GripIn;
    ENDPROC

    PROC HandMove(num nWidth)
        g_MoveTo nWidth;
    ENDPROC

    FUNC num HandWidth()
        RETURN g_GetPos();
    ENDFUNC

    PROC HandVacuum(bool bOn)
        IF bOn THEN
            g_VacuumOn1;
        ELSE
            g_VacuumOff1;
        ENDIF
    ENDPROC

    PROC HandBlow(bool bOn)
        IF bOn THEN
            g_BlowOn1;
        ELSE
            g_BlowOff1;
        ENDIF
    ENDPROC
ENDMODULE
