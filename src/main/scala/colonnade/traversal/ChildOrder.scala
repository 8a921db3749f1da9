package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, Mux1H, PopCount}
import colonnade.config.TraversalConfig
import colonnade.formats.NodeRecord

/** A child by its slot, and its entry distance. */
final class OrderedChild(config: TraversalConfig) extends Bundle {
  val slot = UInt(log2Ceil(NodeRecord.most).W)

  /** Relative to the node, see [[NodeDistance]]. */
  val tNear = SInt(config.numbers.nearBits.W)
}

/** The children that the ray enters: the first `count` of `children`, sorted by entry distance, then by slot. */
final class ChildOrder(config: TraversalConfig) extends Bundle {
  val count    = UInt(log2Ceil(NodeRecord.most + 1).W)
  val children = Vec(NodeRecord.most, new OrderedChild(config))
  val distance = new NodeDistance(config)
}

object ChildOrder {

  /** Sorts by rank, combinationally: all pairs are compared at once, and a child's rank is its number of predecessors.
    */
  def apply(config: TraversalConfig, isEntered: Seq[Bool], tNear: Seq[SInt], distance: NodeDistance): ChildOrder = {
    val slots      = tNear.indices
    val isNotAfter = Map.from(for (i <- slots; j <- slots if i < j) yield (i, j) -> (tNear(i) <= tNear(j)))

    def precedes(i: Int, j: Int): Bool = isEntered(i) && (if (i < j) isNotAfter((i, j)) else !isNotAfter((j, i)))
    val ranks                          = slots.map(slot => PopCount(slots.filter(_ != slot).map(precedes(_, slot))))

    val order = Wire(new ChildOrder(config))
    order.count    := PopCount(isEntered)
    order.distance := distance
    for (rank <- slots) {
      val isHere = slots.map(slot => isEntered(slot) && ranks(slot) === rank.U)
      order.children(rank).slot  := Mux1H(isHere, slots.map(_.U))
      order.children(rank).tNear := Mux1H(isHere, tNear.map(_.asUInt)).asSInt
    }
    order
  }
}
