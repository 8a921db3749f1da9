package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, PopCount}
import colonnade.config.ColonnadeConfig

/** A child that may have been entered, by its slot. */
final class OrderedChild(config: ColonnadeConfig) extends Bundle {
  val slot = UInt(log2Ceil(config.geometry.arity).W)
  val near = UInt((config.numbers.boxDistanceBits - 1).W)
}

/** The children entered: the first `count` of `children`, near to far, the lower slot first among equals. */
final class ChildOrder(config: ColonnadeConfig) extends Bundle {
  val count    = UInt(log2Ceil(config.geometry.arity + 1).W)
  val children = Vec(config.geometry.arity, new OrderedChild(config))
}

object ChildOrder {

  /** Combinational: all pairs are compared at once, and each child goes where its number of predecessors says. */
  def apply(config: ColonnadeConfig, isEntered: Seq[Bool], near: Seq[UInt]): ChildOrder = {
    val slots      = near.indices
    val isNotAfter = Map.from(for (i <- slots; j <- slots if i < j) yield (i, j) -> (near(i) <= near(j)))

    def precedes(i: Int, j: Int): Bool = isEntered(i) && (if (i < j) isNotAfter((i, j)) else !isNotAfter((j, i)))
    val places                         = slots.map(slot => PopCount(slots.filter(_ != slot).map(precedes(_, slot))))

    val order = Wire(new ChildOrder(config))
    order.count := PopCount(isEntered)
    for (place <- slots) {
      val isHere = slots.map(slot => isEntered(slot) && places(slot) === place.U)
      order.children(place).slot := Mux1H(isHere, slots.map(_.U))
      order.children(place).near := Mux1H(isHere, near)
    }
    order
  }
}
