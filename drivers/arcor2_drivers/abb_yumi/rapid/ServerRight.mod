MODULE ServerRight
    ! Motion server of the right arm, for task T_ROB_R. With ServerCommon.mod and one of the Hand modules.

    ! Address of the controller on the network of the hub.
    CONST string SERVER_ADDRESS:="192.168.125.1";
    ! Port of the commands; the watch line has the next one.
    CONST num SERVER_PORT:=6111;
    ! 1: left, 2: right
    CONST num SERVER_ARM:=2;

    PROC main()
        Serve;
    ENDPROC
ENDMODULE
