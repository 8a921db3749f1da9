package chiseltest.formal.backends.bounded

import firrtl2.backends.experimental.smt._

/** Turns the memories of a system into a register a word: few and small as they are in proofs, z3 is much faster so. */
private[bounded] object Memories {
  def toRegisters(system: TransitionSystem): TransitionSystem = system.copy(
    states = system.states.flatMap(toRegisters),
    signals = system.signals.map(signal => signal.copy(e = withoutReads(signal.e)))
  )

  private def toRegisters(state: State): Seq[State] = state.sym match {
    case memory: ArraySymbol =>
      for (i <- 0 until words(memory))
        yield State(word(memory, i), state.init.map(wordOf(_, i)), state.next.map(wordOf(_, i)))
    case _ => Seq(state.copy(init = state.init.map(withoutReads), next = state.next.map(withoutReads)))
  }

  private def words(memory: ArrayExpr): Int = 1 << memory.indexWidth

  private def word(memory: ArraySymbol, i: Int): BVSymbol = BVSymbol(s"${memory.name}_word$i", memory.dataWidth)

  private def wordOf(memory: SMTExpr, i: Int): BVExpr = memory match {
    case symbol: ArraySymbol                => word(symbol, i)
    case ArrayConstant(value, _)            => bits(value)
    case ArrayIte(condition, whenTrue, not) => BVIte(bits(condition), wordOf(whenTrue, i), wordOf(not, i))
    case ArrayStore(before, index, value)   => BVIte(isIndex(index, i), bits(value), wordOf(before, i))
    case other                              => throw new IllegalArgumentException(s"no memory: $other")
  }

  private def isIndex(index: BVExpr, i: Int): BVExpr = BVEqual(bits(index), BVLiteral(i, index.width))

  private def withoutReads(expression: SMTExpr): SMTExpr = expression match {
    case ArrayRead(memory, index) =>
      (1 until words(memory)).foldLeft(wordOf(memory, 0))((rest, i) =>
        BVIte(isIndex(index, i), wordOf(memory, i), rest)
      )
    case other => SMTExprMap.mapExpr(other, withoutReads(_: SMTExpr))
  }

  private def bits(expression: BVExpr): BVExpr = withoutReads(expression).asInstanceOf[BVExpr]
}
