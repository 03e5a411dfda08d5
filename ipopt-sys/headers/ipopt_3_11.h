/* The declarations of Ipopt 3.11 to 3.13, in short: types of its own, Bool is an int. */

typedef double Number;
typedef int Index;
typedef int Int;
typedef int Bool;
typedef void *UserDataPtr;
typedef struct IpoptProblemInfo *IpoptProblem;

enum ApplicationReturnStatus { Solve_Succeeded = 0, User_Requested_Stop = 5, Maximum_Iterations_Exceeded = -1 };

typedef Bool (*Eval_F_CB)(Index, Number *, Bool, Number *, UserDataPtr);
typedef Bool (*Eval_Grad_F_CB)(Index, Number *, Bool, Number *, UserDataPtr);
typedef Bool (*Eval_G_CB)(Index, Number *, Bool, Index, Number *, UserDataPtr);
typedef Bool (*Eval_Jac_G_CB)(Index, Number *, Bool, Index, Index, Index *, Index *, Number *, UserDataPtr);
typedef Bool (*Eval_H_CB)(Index, Number *, Bool, Number, Index, Number *, Bool, Index, Index *, Index *, Number *,
                          UserDataPtr);
typedef Bool (*Intermediate_CB)(Index, Index, Number, Number, Number, Number, Number, Number, Number, Number, Index,
                                UserDataPtr);

IpoptProblem CreateIpoptProblem(Index, Number *, Number *, Index, Number *, Number *, Index, Index, Index, Eval_F_CB,
                                Eval_G_CB, Eval_Grad_F_CB, Eval_Jac_G_CB, Eval_H_CB);
void FreeIpoptProblem(IpoptProblem);
Bool AddIpoptStrOption(IpoptProblem, char *, char *);
Bool AddIpoptNumOption(IpoptProblem, char *, Number);
Bool AddIpoptIntOption(IpoptProblem, char *, Int);
Bool SetIntermediateCallback(IpoptProblem, Intermediate_CB);
enum ApplicationReturnStatus IpoptSolve(IpoptProblem, Number *, Number *, Number *, Number *, Number *, Number *,
                                        UserDataPtr);
