package chiseltest.formal.backends.bounded

import chiseltest.formal.backends.smt.{SolverContext, Z3SMTLib}
import firrtl2.backends.experimental.smt._

/** A cycle of reset and `cycles` more that keep all assumptions, as z3 gets to know them. Each value of each cycle is a
  * constant with an equation, for z3 takes minutes to expand chiseltest's definitions. It is asked one question: the
  * first is the one for which it simplifies everything, later ones take several times as long.
  */
private[bounded] final class Unrolling(system: TransitionSystem, cycles: Int) {
  private val assumptions = system.signals.filter(_.lbl == IsConstraint).map(_.name)

  private val registers = system.states.map(_.sym.asInstanceOf[BVSymbol])
  private val signals   = system.signals.map(signal => signal.sym.asInstanceOf[BVSymbol] -> signal.e)

  /** Inputs, registers and signals: what has a value in each cycle. */
  val symbols: Seq[BVSymbol] = system.inputs ++ registers ++ signals.map(_._1)
  private val names = symbols.map(_.name).toSet

  /** A symbol of one bit in a cycle. */
  def bit(name: String, cycle: Int): BVSymbol = at(BVSymbol(name, 1), cycle)

  def at(symbol: BVSymbol, cycle: Int): BVSymbol = BVSymbol(nameAt(symbol.name, cycle), symbol.width)

  /** What `found` makes of one way for the condition to come true, if there is one.
    *
    * @param known what is known to be true
    */
  def search[T](condition: BVExpr, known: Seq[BVExpr])(found: SolverContext => T): Option[T] = {
    val z3 = Z3SMTLib.createContext()
    try {
      z3.setLogic("QF_BV")
      (0 to cycles).foreach(tell(z3, _))
      known.foreach(z3.assert)
      z3.assert(condition)
      if (z3.check(produceModel = true).isSat) Some(found(z3)) else None
    } finally z3.close()
  }

  private def tell(z3: SolverContext, cycle: Int): Unit = {
    def equate(symbol: BVSymbol, value: SMTExpr): Unit =
      z3.assert(BVEqual(at(symbol, cycle), value.asInstanceOf[BVExpr]))

    symbols.foreach(symbol => z3.runCommand(DeclareFunction(at(symbol, cycle), Seq())))
    for ((register, state) <- registers.zip(system.states)) {
      val value = if (cycle == 0) state.init.map(at(_, 0)) else state.next.map(at(_, cycle - 1))
      value.foreach(equate(register, _))
    }
    for ((signal, value) <- signals) equate(signal, at(value, cycle))
    z3.assert(BVEqual(bit("reset", cycle), BVLiteral(if (cycle == 0) 1 else 0, 1)))
    assumptions.foreach(assumption => z3.assert(bit(assumption, cycle)))
  }

  private def at(expression: SMTExpr, cycle: Int): SMTExpr = expression match {
    case symbol: BVSymbol if names(symbol.name) => at(symbol, cycle)
    case other                                  => SMTExprMap.mapExpr(other, at(_: SMTExpr, cycle))
  }

  private def nameAt(name: String, cycle: Int): String = s"$name@$cycle"
}
