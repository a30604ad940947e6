MODULE ServerCommon
    ! Motion server of one arm: lines of numeric codes on a command socket and on a watch socket. See README.md.
    !
    ! While the arm moves, only the watch socket is read, by a timed interrupt. A stop, or no keep-alive within the time
    ! of the watchdog, stops the arm, clears its path and returns to main; nothing continues by itself.

    CONST num VERSION_NUMBER:=1;
    CONST num BUFFER:=80;
    CONST num MOST_WAYPOINTS:=50;
    CONST num LOOK_IDLE:=0.01;
    CONST num LOOK_MOVING:=0.05;
    CONST num PARTNER_WITHIN:=2;

    CONST num ST_DONE:=0;
    CONST num ST_ACCEPTED:=1;
    CONST num ST_STOPPED:=2;
    CONST num ST_WATCHDOG:=3;
    CONST num ST_BAD_CHECK:=10;
    CONST num ST_BAD_CODE:=11;
    CONST num ST_BAD_COUNT:=12;
    CONST num ST_BAD_VALUE:=13;
    CONST num ST_UNREACHABLE:=14;
    CONST num ST_NO_SESSION:=15;
    CONST num ST_BY_HAND:=16;
    CONST num ST_NO_PARTNER:=20;
    CONST num ST_RAPID_ERROR:=30;

    VAR socketdev sdCommandPort;
    VAR socketdev sdWatchPort;
    VAR socketdev sdCommand;
    VAR socketdev sdWatch;
    VAR string stCommand:="";
    VAR string stWatch:="";

    VAR clock ckHeard;
    VAR num nWatchdog:=0;
    VAR intnum inLook;
    VAR bool bMoving:=FALSE;
    ! A command is executed in which main does not read the watch socket.
    VAR bool bBusy:=FALSE;
    VAR bool bTogether:=FALSE;
    VAR bool bBroken:=FALSE;
    ! The current motion, and how it ended if it was interrupted.
    VAR num nMoveSeq:=0;
    VAR num nMoveCode:=0;
    VAR num nMoveEnd:=0;
    ! The stop to be answered at standstill.
    VAR num nStopSeq:=0;

    ! The last line read.
    VAR num nSeq;
    VAR num nCode;
    VAR num nArg{10};
    VAR num nArgs;

    TASK PERS tooldata tArm:=[TRUE,[[0,0,0],[1,0,0,0]],[0.1,[0,0,1],[1,0,0,0],0,0,0]];
    VAR speeddata vArm:=[100,50,1000,1000];
    VAR zonedata zArm:=[TRUE,0,0,0,0,0,0];
    VAR jointtarget jStaged;
    VAR robtarget pStaged;
    VAR bool bJoints:=FALSE;
    VAR bool bPosition:=FALSE;
    VAR bool bOrientation:=FALSE;
    VAR robtarget pPath{50};
    VAR num nPath:=0;

    PERS tasks tlArms{2}:=[["T_ROB_L"],["T_ROB_R"]];
    VAR syncident syTogether;
    VAR syncident syApart;

    !------------------------------------------------------------------------------------------ connections
    PROC Serve()
        EndLook;
        bMoving:=FALSE;
        bTogether:=FALSE;
        ! After ExitCycle: the arm is at standstill; report the end of the current command.
        IF nMoveSeq>0 THEN
            EndMotion nMoveEnd;
        ENDIF
        IF nStopSeq>0 THEN
            Answer sdWatch,nStopSeq,91,ST_DONE,"";
            nStopSeq:=0;
        ENDIF
        WHILE TRUE DO
            IF bBroken OR SocketGetStatus(sdCommand)<>SOCKET_CONNECTED OR SocketGetStatus(sdWatch)<>SOCKET_CONNECTED THEN
                AcceptClient;
            ENDIF
            LookAtWatch;
            IF NOT bBroken THEN
                LookAtCommands;
            ENDIF
            WaitTime LOOK_IDLE;
        ENDWHILE
    ENDPROC

    ! From here on the interrupt reads the watch socket, and main does not.
    PROC BeginLook()
        bBusy:=TRUE;
        ITimer\Single,LOOK_MOVING,inLook;
    ENDPROC

    PROC EndLook()
        bBusy:=FALSE;
        IDelete inLook;
        CONNECT inLook WITH trLook;
    ENDPROC

    PROC AcceptClient()
        nWatchdog:=0;
        bBroken:=FALSE;
        stCommand:="";
        stWatch:="";
        bJoints:=FALSE;
        bPosition:=FALSE;
        bOrientation:=FALSE;
        nPath:=0;
        SocketClose sdCommand;
        SocketClose sdWatch;
        SocketClose sdCommandPort;
        SocketClose sdWatchPort;
        SocketCreate sdCommandPort;
        SocketBind sdCommandPort,SERVER_ADDRESS,SERVER_PORT;
        SocketListen sdCommandPort;
        SocketCreate sdWatchPort;
        SocketBind sdWatchPort,SERVER_ADDRESS,SERVER_PORT+1;
        SocketListen sdWatchPort;
        SocketAccept sdCommandPort,sdCommand\Time:=WAIT_MAX;
        SocketAccept sdWatchPort,sdWatch\Time:=2;
        ! One client at a time: others are refused while it is connected.
        SocketClose sdCommandPort;
        SocketClose sdWatchPort;
    ERROR
        bBroken:=TRUE;
        WaitTime 0.2;
        RETURN ;
    ENDPROC

    PROC LookAtCommands()
        VAR string stLine;
        IF NextLine(sdCommand,stCommand,stLine) THEN
            Parse stLine;
            IF nCode<0 THEN
                Answer sdCommand,0,0,-nCode,"";
            ELSE
                Obey;
            ENDIF
        ENDIF
    ERROR
        bBroken:=TRUE;
        RETURN ;
    ENDPROC

    ! Keep-alive and stop. Called from main at standstill, and from the interrupt during a motion.
    PROC LookAtWatch()
        VAR string stLine;
        WHILE NextLine(sdWatch,stWatch,stLine) DO
            Parse stLine;
            IF nCode<0 THEN
                Answer sdWatch,0,0,-nCode,"";
            ELSEIF nCode=90 THEN
                ClkReset ckHeard;
                ClkStart ckHeard;
                Answer sdWatch,nSeq,90,ST_DONE,Flag(bMoving)+Flag(nWatchdog>0);
            ELSEIF nCode=91 THEN
                IF bMoving THEN
                    nStopSeq:=nSeq;
                ELSE
                    Answer sdWatch,nSeq,91,ST_DONE,"";
                ENDIF
            ELSE
                Answer sdWatch,nSeq,nCode,ST_BAD_CODE,"";
            ENDIF
        ENDWHILE
        IF nWatchdog>0 AND ClkRead(ckHeard)>nWatchdog THEN
            nWatchdog:=0;
        ENDIF
    ERROR
        bBroken:=TRUE;
        nWatchdog:=0;
        RETURN ;
    ENDPROC

    TRAP trLook
        VAR num nKeptSeq;
        VAR num nKeptCode;
        nKeptSeq:=nSeq;
        nKeptCode:=nCode;
        LookAtWatch;
        nSeq:=nKeptSeq;
        nCode:=nKeptCode;
        IF bMoving AND (nStopSeq>0 OR nWatchdog=0) THEN
            nMoveEnd:=ST_WATCHDOG;
            IF nStopSeq>0 THEN
                nMoveEnd:=ST_STOPPED;
            ENDIF
            StopMove\Quick;
            ClearPath;
            IF bTogether THEN
                SyncMoveUndo;
            ENDIF
            StartMove;
            ExitCycle;
        ENDIF
        IF bBusy THEN
            ITimer\Single,LOOK_MOVING,inLook;
        ENDIF
    ENDTRAP

    !------------------------------------------------------------------------------------------ lines
    ! Reads the socket, and returns the next complete line.
    FUNC bool NextLine(VAR socketdev sd,VAR string stBuffer,VAR string stLine)
        VAR num nBytes;
        VAR num nAt;
        VAR string stPart;
        nBytes:=SocketPeek(sd);
        IF nBytes>BUFFER-StrLen(stBuffer) THEN
            nBytes:=BUFFER-StrLen(stBuffer);
        ENDIF
        IF nBytes>0 THEN
            SocketReceive sd\Str:=stPart\ReadNoOfBytes:=nBytes\Time:=1;
            stBuffer:=stBuffer+stPart;
        ENDIF
        nAt:=StrFind(stBuffer,1,"\0A");
        IF nAt>StrLen(stBuffer) THEN
            IF StrLen(stBuffer)>=BUFFER THEN
                stBuffer:="";
            ENDIF
            RETURN FALSE;
        ENDIF
        stLine:="";
        IF nAt>1 THEN
            stLine:=StrPart(stBuffer,1,nAt-1);
        ENDIF
        IF nAt<StrLen(stBuffer) THEN
            stBuffer:=StrPart(stBuffer,nAt+1,StrLen(stBuffer)-nAt);
        ELSE
            stBuffer:="";
        ENDIF
        RETURN TRUE;
    ENDFUNC

    FUNC num Check(string stText)
        VAR num nSum:=0;
        FOR i FROM 1 TO StrLen(stText) DO
            nSum:=nSum+i*StrToByte(StrPart(stText,i,1)\Char);
        ENDFOR
        RETURN nSum MOD 997;
    ENDFUNC

    ! Decodes a line; a negative code is minus the status of the answer.
    PROC Parse(string stLine)
        VAR num nStar;
        VAR num nFrom:=1;
        VAR num nTo;
        VAR num nField:=0;
        VAR num nValue;
        VAR string stText;
        nCode:=-ST_BAD_CHECK;
        nArgs:=0;
        nStar:=StrFind(stLine,1,"*");
        IF nStar<2 OR nStar>=StrLen(stLine) THEN
            RETURN ;
        ENDIF
        stText:=StrPart(stLine,1,nStar-1);
        IF NOT StrToVal(StrPart(stLine,nStar+1,StrLen(stLine)-nStar),nValue) THEN
            RETURN ;
        ENDIF
        IF nValue<>Check(stText) THEN
            RETURN ;
        ENDIF
        WHILE nFrom<=StrLen(stText) DO
            nTo:=StrFind(stText,nFrom,STR_WHITE);
            IF NOT StrToVal(StrPart(stText,nFrom,nTo-nFrom),nValue) OR nField>11 THEN
                nCode:=-ST_BAD_VALUE;
                RETURN ;
            ENDIF
            nField:=nField+1;
            IF nField=1 THEN
                nSeq:=nValue;
            ELSEIF nField=2 THEN
                nCode:=nValue;
            ELSE
                nArgs:=nField-2;
                nArg{nArgs}:=nValue;
            ENDIF
            nFrom:=nTo+1;
        ENDWHILE
    ENDPROC

    PROC Answer(VAR socketdev sd,num nToSeq,num nToCode,num nStatus,string stValues)
        VAR string stText;
        stText:=NumToStr(nToSeq,0)+" "+NumToStr(nToCode,0)+" "+NumToStr(nStatus,0)+stValues;
        SocketSend sd\Str:=stText+"*"+NumToStr(Check(stText),0)+"\0A";
    ERROR
        bBroken:=TRUE;
        RETURN ;
    ENDPROC

    PROC Tell(num nStatus)
        Answer sdCommand,nSeq,nCode,nStatus,"";
    ENDPROC

    PROC TellValues(string stValues)
        Answer sdCommand,nSeq,nCode,ST_DONE,stValues;
    ENDPROC

    FUNC string Flag(bool bValue)
        IF bValue THEN
            RETURN " 1";
        ENDIF
        RETURN " 0";
    ENDFUNC

    ! Formats a number so that seven joints fit into a line.
    FUNC string Number(num nValue)
        RETURN " "+NumToStr(nValue,3);
    ENDFUNC

    ! Formats a component of a quaternion.
    FUNC string Part(num nValue)
        RETURN " "+NumToStr(nValue,6);
    ENDFUNC

    FUNC string JointNumbers(jointtarget j)
        RETURN Number(j.robax.rax_1)+Number(j.robax.rax_2)+Number(j.robax.rax_3)+Number(j.robax.rax_4)+Number(j.robax.rax_5)+Number(j.robax.rax_6)+Number(j.extax.eax_a);
    ENDFUNC

    FUNC string PositionNumbers(robtarget p)
        RETURN Number(p.trans.x)+Number(p.trans.y)+Number(p.trans.z)+Number(p.extax.eax_a);
    ENDFUNC

    FUNC string OrientationNumbers(robtarget p)
        RETURN Part(p.rot.q1)+Part(p.rot.q2)+Part(p.rot.q3)+Part(p.rot.q4)+" "+NumToStr(p.robconf.cf1,0)+" "+NumToStr(p.robconf.cf4,0)+" "+NumToStr(p.robconf.cf6,0)+" "+NumToStr(p.robconf.cfx,0);
    ENDFUNC

    !------------------------------------------------------------------------------------------ commands
    FUNC num Arguments(num nOfCode)
        TEST nOfCode
        CASE 1,3,10,11,12,23,24,31,33,40,41,42,50,53:
            RETURN 0;
        CASE 2,5,30,32,51,52,54,55:
            RETURN 1;
        CASE 4,34:
            RETURN 2;
        CASE 7,21:
            RETURN 4;
        CASE 6,20:
            RETURN 7;
        CASE 22:
            RETURN 8;
        ENDTEST
        RETURN -1;
    ENDFUNC

    FUNC bool NeedsSession(num nOfCode)
        RETURN nOfCode=6 OR nOfCode=7 OR (nOfCode>=30 AND nOfCode<40) OR (nOfCode>=50 AND nOfCode<>53);
    ENDFUNC

    PROC Obey()
        IF Arguments(nCode)<0 THEN
            Tell ST_BAD_CODE;
        ELSEIF Arguments(nCode)<>nArgs THEN
            Tell ST_BAD_COUNT;
        ELSEIF NeedsSession(nCode) AND nWatchdog=0 THEN
            Tell ST_NO_SESSION;
        ELSEIF nCode<10 THEN
            Configure;
        ELSEIF nCode<20 OR nCode>=40 AND nCode<50 THEN
            TellWhere;
        ELSEIF nCode<30 THEN
            Stage;
        ELSEIF nCode<40 THEN
            Move;
        ELSE
            UseHand;
        ENDIF
    ERROR
        IF nMoveSeq>0 THEN
            nMoveEnd:=ST_RAPID_ERROR;
            StopMove\Quick;
            ClearPath;
            IF bTogether THEN
                SyncMoveUndo;
            ENDIF
            StartMove;
            bMoving:=FALSE;
            bTogether:=FALSE;
            EndLook;
            IF ERRNO=ERR_SYNCMOVEON THEN
                EndMotion ST_NO_PARTNER;
            ELSEIF ERRNO=ERR_ROBLIMIT OR ERRNO=ERR_OUTSIDE_REACH THEN
                EndMotion ST_UNREACHABLE;
            ELSE
                EndMotion ST_RAPID_ERROR;
            ENDIF
        ELSEIF ERRNO=ERR_ROBLIMIT OR ERRNO=ERR_OUTSIDE_REACH THEN
            Tell ST_UNREACHABLE;
        ELSE
            EndLook;
            Answer sdCommand,nSeq,nCode,ST_RAPID_ERROR," "+NumToStr(ERRNO,0);
        ENDIF
        RETURN ;
    ENDPROC

    PROC Configure()
        VAR bool bGood:=TRUE;
        TEST nCode
        CASE 1:
            TellValues Number(VERSION_NUMBER)+Number(SERVER_ARM);
            RETURN ;
        CASE 2:
            bGood:=nArg{1}>=0.1 AND nArg{1}<=5;
            IF bGood THEN
                nWatchdog:=nArg{1};
                ClkReset ckHeard;
                ClkStart ckHeard;
            ENDIF
        CASE 3:
            nWatchdog:=0;
        CASE 4:
            bGood:=nArg{1}>=0.1 AND nArg{1}<=1500 AND nArg{2}>=0.1 AND nArg{2}<=500;
            IF bGood THEN
                vArm.v_tcp:=nArg{1};
                vArm.v_ori:=nArg{2};
            ENDIF
        CASE 5:
            bGood:=nArg{1}>=0 AND nArg{1}<=200;
            IF bGood THEN
                zArm:=[nArg{1}=0,nArg{1},1.5*nArg{1},1.5*nArg{1},0.15*nArg{1},1.5*nArg{1},0.15*nArg{1}];
            ENDIF
        CASE 6:
            tArm.tframe:=[[nArg{1},nArg{2},nArg{3}],NOrient([nArg{4},nArg{5},nArg{6},nArg{7}])];
        CASE 7:
            bGood:=nArg{1}>0 AND nArg{1}<=0.75;
            IF bGood THEN
                tArm.tload:=[nArg{1},[nArg{2},nArg{3},nArg{4}],[1,0,0,0],0,0,0];
            ENDIF
        ENDTEST
        IF bGood THEN
            Tell ST_DONE;
        ELSE
            Tell ST_BAD_VALUE;
        ENDIF
    ENDPROC

    PROC TellWhere()
        VAR robtarget p;
        IF nCode=40 AND NOT (bPosition AND bOrientation) OR nCode>40 AND NOT bJoints THEN
            Tell ST_BAD_VALUE;
            RETURN ;
        ENDIF
        TEST nCode
        CASE 10:
            TellValues JointNumbers(CJointT());
            RETURN ;
        CASE 40:
            TellValues JointNumbers(CalcJointT(pStaged,tArm\WObj:=wobj0));
            RETURN ;
        CASE 11,12:
            p:=CRobT(\Tool:=tArm\WObj:=wobj0);
        DEFAULT:
            p:=CalcRobT(jStaged,tArm\WObj:=wobj0);
        ENDTEST
        IF nCode=11 OR nCode=41 THEN
            TellValues PositionNumbers(p);
        ELSE
            TellValues OrientationNumbers(p);
        ENDIF
    ENDPROC

    PROC Stage()
        TEST nCode
        CASE 20:
            jStaged:=[[nArg{1},nArg{2},nArg{3},nArg{4},nArg{5},nArg{6}],[nArg{7},9E+09,9E+09,9E+09,9E+09,9E+09]];
            bJoints:=TRUE;
        CASE 21:
            pStaged.trans:=[nArg{1},nArg{2},nArg{3}];
            pStaged.extax:=[nArg{4},9E+09,9E+09,9E+09,9E+09,9E+09];
            bPosition:=TRUE;
        CASE 22:
            pStaged.rot:=NOrient([nArg{1},nArg{2},nArg{3},nArg{4}]);
            pStaged.robconf:=[nArg{5},nArg{6},nArg{7},nArg{8}];
            bOrientation:=TRUE;
        CASE 23:
            nPath:=0;
        CASE 24:
            IF nPath>=MOST_WAYPOINTS OR NOT (bPosition AND bOrientation) THEN
                Tell ST_BAD_VALUE;
                RETURN ;
            ENDIF
            nPath:=nPath+1;
            pPath{nPath}:=pStaged;
        ENDTEST
        Tell ST_DONE;
    ENDPROC

    !------------------------------------------------------------------------------------------ motion
    PROC Move()
        IF ((nCode=30 OR nCode=34) AND NOT bJoints) OR ((nCode=31 OR nCode=32) AND NOT (bPosition AND bOrientation)) OR (nCode=33 AND nPath=0) THEN
            Tell ST_BAD_VALUE;
            RETURN ;
        ENDIF
        IF (nCode=30 OR nCode=32) AND nArg{1}<=0 OR nCode=34 AND nArg{2}<=0 THEN
            Tell ST_BAD_VALUE;
            RETURN ;
        ENDIF
        nMoveSeq:=nSeq;
        nMoveCode:=nCode;
        nMoveEnd:=ST_DONE;
        bMoving:=TRUE;
        BeginLook;
        ConfJ\On;
        ConfL\Off;
        TEST nCode
        CASE 30:
            Tell ST_ACCEPTED;
            MoveAbsJ jStaged\NoEOffs,vArm\T:=nArg{1},fine,tArm\WObj:=wobj0;
        CASE 31:
            Tell ST_ACCEPTED;
            MoveL pStaged,vArm,fine,tArm\WObj:=wobj0;
        CASE 32:
            Tell ST_ACCEPTED;
            MoveJ pStaged,vArm\T:=nArg{1},fine,tArm\WObj:=wobj0;
        CASE 33:
            Tell ST_ACCEPTED;
            FOR i FROM 1 TO nPath DO
                IF i<nPath AND NOT zArm.finep THEN
                    MoveL pPath{i},vArm,zArm,tArm\WObj:=wobj0;
                ELSE
                    MoveL pPath{i},vArm,fine,tArm\WObj:=wobj0;
                ENDIF
            ENDFOR
        CASE 34:
            ! Both tasks wait for each other; the controller starts and ends the two motions together.
            SyncMoveOn syTogether,tlArms\TimeOut:=PARTNER_WITHIN;
            bTogether:=TRUE;
            Tell ST_ACCEPTED;
            MoveAbsJ jStaged\ID:=10\NoEOffs,vArm\T:=nArg{2},fine,tArm\WObj:=wobj0;
            SyncMoveOff syApart\TimeOut:=PARTNER_WITHIN;
            bTogether:=FALSE;
        ENDTEST
        bMoving:=FALSE;
        EndLook;
        EndMotion ST_DONE;
        ! A stop that came too late to have an effect.
        IF nStopSeq>0 THEN
            Answer sdWatch,nStopSeq,91,ST_DONE,"";
            nStopSeq:=0;
        ENDIF
    ENDPROC

    PROC EndMotion(num nStatus)
        VAR num nEnded;
        nEnded:=nMoveSeq;
        nMoveSeq:=0;
        Answer sdCommand,nEnded,nMoveCode,nStatus,"";
    ENDPROC

    PROC UseHand()
        BeginLook;
        TEST nCode
        CASE 50:
            HandCalibrate;
        CASE 51:
            HandGrip nArg{1};
        CASE 52:
            HandMove nArg{1};
        CASE 54:
            HandVacuum nArg{1}>0;
        CASE 55:
            HandBlow nArg{1}>0;
        ENDTEST
        EndLook;
        IF nCode<=53 THEN
            TellValues Number(HandWidth());
        ELSE
            Tell ST_DONE;
        ENDIF
    ENDPROC
ENDMODULE
