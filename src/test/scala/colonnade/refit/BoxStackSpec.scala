package colonnade.refit

import chiseltest._
import colonnade.formats.NodeRecord
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Nodes get the boxes of what was built last, up to a full stack; what does not fit is an error, and changes nothing.
  */
class BoxStackSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "BoxStack"

  it should "give nodes their children, and report a full stack and children that are not there" in
    test(new BoxStack(TestConfigs.tiny)).withAnnotations(Simulation.verilator) { dut =>
      val random = new Random(1)
      dut.clock.setTimeout(0)
      dut.io.leaves.ready.poke(true)

      // Boxes by axis: the least and the greatest coordinate
      type Box = Seq[(Int, Int)]
      var stack  = Vector.empty[Box]
      var errors = 0

      def give(kind: BigInt, children: Int, box: Box): Unit = {
        val item = dut.io.items.bits
        item.entry.head.poke(kind)
        item.entry.words(1).poke(children)
        for (((low, high), (least, most)) <- item.low.axes.zip(item.high.axes).zip(box)) {
          low.poke(least)
          high.poke(most)
        }
        dut.io.items.valid.poke(true)
        while (!dut.io.items.ready.peekBoolean()) dut.clock.step()
        if (dut.io.isError.peekBoolean()) errors += 1
        dut.clock.step()
        dut.io.items.valid.poke(false)
      }
      def leaf(): Unit = {
        val box    = Seq.fill(3)(random.nextInt(1 << 15)).map(least => (least, least + random.nextInt(1 << 15)))
        val isFull = stack.size == RefitPlan.boxes
        val before = errors
        give(RefitKind.triangle.litValue, 0, box)
        errors shouldBe before + (if (isFull) 1 else 0)
        if (!isFull) stack :+= box
      }
      def node(children: Int): Unit = {
        val isLegal = children > 0 && children <= NodeRecord.most && children <= stack.size
        val before  = errors
        give(RefitKind.node.litValue, children, Seq.fill(3)((0, 0)))
        errors shouldBe before + (if (isLegal) 0 else 1)
        if (isLegal) {
          for (_ <- 0 until random.nextInt(20)) dut.clock.step()
          while (!dut.io.nodes.valid.peekBoolean()) dut.clock.step()
          val own   = stack.takeRight(children)
          val whole = own.transpose.map(axis => (axis.map(_._1).min, axis.map(_._2).max))
          for ((box, expected) <- dut.io.nodes.bits.boxes.take(children).zip(own) :+ (dut.io.nodes.bits.all -> whole)) {
            box.low.axes.map(_.peekInt()) shouldBe expected.map(_._1)
            box.below.axes.map(_.peekInt()) shouldBe expected.map(_._2 - 1)
          }
          dut.io.nodes.ready.poke(true)
          dut.clock.step()
          dut.io.nodes.ready.poke(false)
          stack = stack.dropRight(children) :+ whole
        }
      }

      node(1)
      for (_ <- 0 until 40) if (random.nextInt(3) > 0) leaf() else node(random.nextInt(NodeRecord.most + 2))
      while (stack.size < RefitPlan.boxes) leaf()
      for (_ <- 0 until 3) leaf()
      while (stack.size > 1) node(NodeRecord.most.min(stack.size))
      leaf()
      node(3)
      dut.io.clear.poke(true)
      dut.clock.step()
      dut.io.clear.poke(false)
      stack = Vector.empty
      node(1)
    }
}
