package colonnade.unit

import chiseltest._
import colonnade.TestConfigs
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A fetch matches the buffers that have its address from the comparison until the match is used. */
class RecordLookupSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RecordLookup"

  private val contexts = 3
  private val buffers  = 3
  private val plain    = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(recordBuffers = buffers)
  )

  for ((config, latency) <- Seq(plain -> 1, TestConfigs.withExtraSlices(plain) -> 3))
    it should s"find the buffers of an address after $latency cycles, while buffers take others" in
      test(new RecordLookup(config)) { dut =>
        val random    = new Random(latency)
        var addresses = Seq.fill(buffers)(0)
        var fetches   = Map.empty[Int, (Int, Int, Seq[Boolean])] // by context: its age, its address, what it may match
        var (found, lost) = (0, 0)
        for (_ <- 0 until 2000) {
          val isWritten = Seq.fill(buffers)(random.nextInt(4) == 0)
          for (buffer <- 0 until buffers) {
            dut.io.addresses(buffer).poke(addresses(buffer))
            dut.io.isWritten(buffer).poke(isWritten(buffer))
          }
          fetches = fetches.map { case (context, (age, address, matches)) =>
            val is = if (age == 1) addresses.map(_ == address) else matches
            context -> ((age, address, is))
          }
          for (context <- 0 until contexts) {
            val age = fetches.get(context).map(_._1)
            dut.io.isNew(context).expect(age.contains(1))
            dut.io.isUnderWay(context).expect(age.exists(_ < latency))
            dut.io.isSettling(context).expect(age.exists(_ <= latency))
          }
          for ((context, (age, address, matches)) <- fetches if age == latency) {
            for (buffer <- 0 until buffers) dut.io.matches(context)(buffer).expect(matches(buffer))
            assert(matches.zip(addresses).forall { case (isMatch, of) => !isMatch || of == address })
            found += matches.count(identity)
            lost += matches.zip(addresses).count { case (isMatch, of) => !isMatch && of == address }
          }
          fetches = fetches.collect {
            case (context, (age, address, matches)) if age < latency =>
              context -> ((age + 1, address, matches.zip(isWritten).map { case (is, written) => is && !written }))
          }
          val idle = random.shuffle((0 until contexts).filterNot(fetches.contains).toList)
          for ((port, index) <- dut.io.fetches.zipWithIndex) {
            val context = idle.lift(index).filter(_ => random.nextBoolean())
            val address = random.nextInt(3)
            port.valid.poke(context.nonEmpty)
            port.bits.context.poke(context.getOrElse(0))
            port.bits.address.poke(address)
            context.foreach(fetches += _ -> ((1, address, Seq.fill(buffers)(false))))
          }
          dut.clock.step()
          addresses = addresses.zip(isWritten).map { case (of, written) => if (written) random.nextInt(3) else of }
        }
        assert(found > 100 && (lost > 0) == (latency > 1))
      }
}

/** The first ready context of the kind with the highest priority is granted in the next cycle. */
class RecordGrantSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RecordGrant"

  private val contexts = 5
  private val buffers  = 3
  private val config   = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(recordBuffers = buffers)
  )

  it should "serve triangles before attributes before nodes, and only kinds whose unit accepts a record" in
    test(new RecordGrant(config)) { dut =>
      val random   = new Random(7)
      val priority = Seq(RecordKind.leaf, RecordKind.colours, RecordKind.node)
      var granted  = Option.empty[(Int, RecordKind.Type, Int)]
      for (_ <- 0 until 1000) {
        val ready   = Seq.fill(contexts)(random.nextInt(3) == 0)
        val kinds   = Seq.fill(contexts)(RecordKind.all(random.nextInt(3)))
        val holders = Seq.fill(contexts)(random.nextInt(buffers))
        val accepts = RecordKind.all.map(_.litValue -> random.nextBoolean()).toMap
        for (context <- 0 until contexts) {
          dut.io.isReady(context).poke(ready(context))
          dut.io.kinds(context).poke(kinds(context))
          for (buffer <- 0 until buffers) dut.io.holders(context)(buffer).poke(holders(context) == buffer)
        }
        for ((kind, port) <- RecordKind.all.zip(dut.io.readyNext)) port.poke(accepts(kind.litValue))
        dut.io.granted.valid.expect(granted.nonEmpty)
        for ((context, kind, holder) <- granted) {
          dut.io.granted.bits.context.expect(context)
          dut.io.granted.bits.kind.expect(kind)
          for (buffer <- 0 until buffers) dut.io.granted.bits.buffer(buffer).expect(buffer == holder)
        }
        granted = (for {
          kind    <- priority if accepts(kind.litValue)
          context <- 0 until contexts if ready(context) && kinds(context).litValue == kind.litValue
        } yield (context, kind, holders(context))).headOption
        dut.io.grantNext.valid.expect(granted.nonEmpty)
        dut.io.grantsNodeNext.expect(granted.exists(_._2.litValue == RecordKind.node.litValue))
        for ((context, _, _) <- granted) dut.io.grantNext.bits.expect(context)
        for (context <- 0 until contexts) dut.io.grantOH(context).expect(granted.exists(_._1 == context))
        dut.clock.step()
      }
    }
}
